#include "alidade/imaging/image_codecs.h"

#include <array>
#include <charconv>
#include <csetjmp>
#include <cstdio>
// needs FILE and size_t declared before it
#include <jpeglib.h>
#include <png.h>
#include <webp/decode.h>
#include <zlib.h>

#include <cstring>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>
#include <stdexcept>
#include <vector>

#include "alidade/imaging/image_size.h"
#include "alidade/imaging/tiff_image.h"

namespace alidade {
namespace {

bool begins_with(std::string_view bytes, std::string_view magic) { return bytes.substr(0, magic.size()) == magic; }

// --- JPEG -----------------------------------------------------------------------------------------------------------

struct JpegFault {
  jpeg_error_mgr manager;
  std::jmp_buf place;
};

void fail_jpeg(j_common_ptr info) { std::longjmp(reinterpret_cast<JpegFault*>(info->err)->place, 1); }
void say_nothing(j_common_ptr) {}

jpeg_error_mgr* quiet_errors(JpegFault& fault) {
  jpeg_error_mgr* manager = jpeg_std_error(&fault.manager);
  manager->error_exit = fail_jpeg;
  manager->output_message = say_nothing;
  return manager;
}

/// Four inks as Adobe stores them, inverted, in colours.
void inks_to_bgr(const cv::Mat& inks, cv::Mat& bgr) {
  bgr.create(inks.rows, inks.cols, CV_8UC3);
  for (int row = 0; row < inks.rows; ++row) {
    for (int col = 0; col < inks.cols; ++col) {
      const cv::Vec4b& ink = inks.at<cv::Vec4b>(row, col);
      for (int i = 0; i < 3; ++i) {
        const int black = ink[3];
        bgr.at<cv::Vec3b>(row, col)[2 - i] = static_cast<unsigned char>(black - (((255 - ink[i]) * black) >> 8));
      }
    }
  }
}

/// What longjmp would pass over must not need a destructor: the pixels belong to the caller.
bool read_jpeg(std::string_view bytes, cv::Mat& image) {
  jpeg_decompress_struct info{};
  JpegFault fault{};
  info.err = quiet_errors(fault);
  if (setjmp(fault.place) != 0) {
    jpeg_destroy_decompress(&info);
    return false;
  }
  jpeg_create_decompress(&info);
  jpeg_mem_src(&info, reinterpret_cast<const unsigned char*>(bytes.data()), bytes.size());
  jpeg_read_header(&info, TRUE);
  if (!is_possible_image(info.image_width, info.image_height, bytes.size()))
    fail_jpeg(reinterpret_cast<j_common_ptr>(&info));
  const bool is_ink = info.jpeg_color_space == JCS_CMYK || info.jpeg_color_space == JCS_YCCK;
  if (is_ink) {
    info.out_color_space = JCS_CMYK;
  } else {
    info.out_color_space = info.num_components == 1 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  }
  jpeg_start_decompress(&info);
  image.create(static_cast<int>(info.output_height), static_cast<int>(info.output_width),
               CV_8UC(info.output_components));
  while (info.output_scanline < info.output_height) {
    JSAMPROW row = image.ptr<unsigned char>(static_cast<int>(info.output_scanline));
    jpeg_read_scanlines(&info, &row, 1);
  }
  jpeg_finish_decompress(&info);
  jpeg_destroy_decompress(&info);
  return true;
}

cv::Mat decode_jpeg(std::string_view bytes) {
  cv::Mat image, colours;
  if (!read_jpeg(bytes, image)) return {};
  if (image.channels() != 4) return image;
  inks_to_bgr(image, colours);
  return colours;
}

bool write_jpeg(const cv::Mat& image, int quality, unsigned char*& out, unsigned long& size) {
  jpeg_compress_struct info{};
  JpegFault fault{};
  info.err = quiet_errors(fault);
  if (setjmp(fault.place) != 0) {
    jpeg_destroy_compress(&info);
    return false;
  }
  jpeg_create_compress(&info);
  jpeg_mem_dest(&info, &out, &size);
  info.image_width = static_cast<JDIMENSION>(image.cols);
  info.image_height = static_cast<JDIMENSION>(image.rows);
  info.input_components = image.channels();
  info.in_color_space = image.channels() == 1 ? JCS_GRAYSCALE : JCS_EXT_BGR;
  jpeg_set_defaults(&info);
  jpeg_set_quality(&info, quality, TRUE);
  jpeg_start_compress(&info, TRUE);
  while (info.next_scanline < info.image_height) {
    JSAMPROW row = const_cast<unsigned char*>(image.ptr<unsigned char>(static_cast<int>(info.next_scanline)));
    jpeg_write_scanlines(&info, &row, 1);
  }
  jpeg_finish_compress(&info);
  jpeg_destroy_compress(&info);
  return true;
}

// --- PNG ------------------------------------------------------------------------------------------------------------

/// The file in memory, and how far it was read.
struct PngSource {
  std::string_view bytes;
  std::size_t at = 0;
};

void take_png(png_structp png, png_bytep out, std::size_t size) {
  auto& source = *static_cast<PngSource*>(png_get_io_ptr(png));
  if (size > source.bytes.size() - source.at) png_error(png, "cut off");
  std::memcpy(out, source.bytes.data() + source.at, size);
  source.at += size;
}

void put_png(png_structp png, png_bytep bytes, std::size_t size) {
  static_cast<std::string*>(png_get_io_ptr(png))->append(reinterpret_cast<const char*>(bytes), size);
}

void no_flush(png_structp) {}
void no_warning(png_structp, png_const_charp) {}
[[noreturn]] void fail_png(png_structp png, png_const_charp) { png_longjmp(png, 1); }

/// Grey or BGR(A) of 8 or 16 bit, whatever is in the file.
void plan_png(png_structp png, png_infop info, bool keep_alpha) {
  const int depth = png_get_bit_depth(png, info), kind = png_get_color_type(png, info);
  if (kind == PNG_COLOR_TYPE_PALETTE) png_set_palette_to_rgb(png);
  if (kind == PNG_COLOR_TYPE_GRAY && depth < 8) png_set_expand_gray_1_2_4_to_8(png);
  const bool has_alpha = (kind & PNG_COLOR_MASK_ALPHA) != 0 || png_get_valid(png, info, PNG_INFO_tRNS) != 0;
  if (has_alpha && keep_alpha) {
    if (png_get_valid(png, info, PNG_INFO_tRNS) != 0) png_set_tRNS_to_alpha(png);
    if ((kind & PNG_COLOR_MASK_COLOR) == 0) png_set_gray_to_rgb(png);  // there is no grey with transparency
  } else {
    png_set_strip_alpha(png);
  }
  if (depth == 16) png_set_swap(png);
  png_set_bgr(png);
  png_set_interlace_handling(png);
  png_read_update_info(png, info);
}

bool read_png(PngSource& source, bool keep_alpha, cv::Mat& image, std::vector<png_bytep>& rows) {
  png_structp png = png_create_read_struct(PNG_LIBPNG_VER_STRING, nullptr, fail_png, no_warning);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_read_struct(&png, &info, nullptr);
    return false;
  }
  png_set_read_fn(png, &source, take_png);
  png_read_info(png, info);
  const std::size_t width = png_get_image_width(png, info), height = png_get_image_height(png, info);
  if (!is_possible_image(width, height, source.bytes.size())) fail_png(png, "");
  plan_png(png, info, keep_alpha);
  const int depth = png_get_bit_depth(png, info) == 16 ? CV_16U : CV_8U;
  image.create(static_cast<int>(png_get_image_height(png, info)), static_cast<int>(png_get_image_width(png, info)),
               CV_MAKETYPE(depth, png_get_channels(png, info)));
  rows.resize(static_cast<std::size_t>(image.rows));
  for (int row = 0; row < image.rows; ++row) rows[static_cast<std::size_t>(row)] = image.ptr(row);
  png_read_image(png, rows.data());
  png_read_end(png, nullptr);
  png_destroy_read_struct(&png, &info, nullptr);
  return true;
}

cv::Mat decode_png(std::string_view bytes, bool keep_alpha) {
  PngSource source{bytes};
  cv::Mat image;
  std::vector<png_bytep> rows;
  return read_png(source, keep_alpha, image, rows) ? image : cv::Mat();
}

int png_kind(int channels) {
  if (channels == 1) return PNG_COLOR_TYPE_GRAY;
  return channels == 3 ? PNG_COLOR_TYPE_RGB : PNG_COLOR_TYPE_RGB_ALPHA;
}

bool write_png(const cv::Mat& image, std::string& out) {
  png_structp png = png_create_write_struct(PNG_LIBPNG_VER_STRING, nullptr, fail_png, no_warning);
  if (png == nullptr) return false;
  png_infop info = png_create_info_struct(png);
  if (setjmp(png_jmpbuf(png)) != 0) {
    png_destroy_write_struct(&png, &info);
    return false;
  }
  png_set_write_fn(png, &out, put_png, no_flush);
  png_set_IHDR(png, info, static_cast<png_uint_32>(image.cols), static_cast<png_uint_32>(image.rows),
               image.depth() == CV_16U ? 16 : 8, png_kind(image.channels()), PNG_INTERLACE_NONE,
               PNG_COMPRESSION_TYPE_DEFAULT, PNG_FILTER_TYPE_DEFAULT);
  // Rendered noise does not compress: what is fast is as small.
  png_set_filter(png, PNG_FILTER_TYPE_BASE, PNG_FILTER_SUB);
  png_set_compression_level(png, 1);
  png_set_compression_strategy(png, Z_RLE);
  png_write_info(png, info);
  png_set_bgr(png);
  if (image.depth() == CV_16U) png_set_swap(png);
  for (int row = 0; row < image.rows; ++row) png_write_row(png, const_cast<png_bytep>(image.ptr(row)));
  png_write_end(png, nullptr);
  png_destroy_write_struct(&png, &info);
  return true;
}

// --- the others -----------------------------------------------------------------------------------------------------

cv::Mat decode_webp(std::string_view bytes, bool keep_alpha) {
  const auto* data = reinterpret_cast<const unsigned char*>(bytes.data());
  WebPBitstreamFeatures about;
  if (WebPGetFeatures(data, bytes.size(), &about) != VP8_STATUS_OK || about.has_animation != 0) return {};
  const bool alpha = keep_alpha && about.has_alpha != 0;
  cv::Mat image(about.height, about.width, alpha ? CV_8UC4 : CV_8UC3);
  const std::size_t size = image.total() * image.elemSize();
  const int stride = static_cast<int>(image.step);
  const unsigned char* decoded = alpha ? WebPDecodeBGRAInto(data, bytes.size(), image.data, size, stride)
                                       : WebPDecodeBGRInto(data, bytes.size(), image.data, size, stride);
  return decoded != nullptr ? image : cv::Mat();
}

unsigned little_endian(std::string_view bytes, std::size_t at, std::size_t size) {
  unsigned value = 0;
  for (std::size_t i = 0; i < size && at + i < bytes.size(); ++i) {
    value |= static_cast<unsigned>(static_cast<unsigned char>(bytes[at + i])) << (8 * i);
  }
  return value;
}

/// Uncompressed, of 8 (with its palette), 24 or 32 bit.
cv::Mat decode_bmp(std::string_view bytes) {
  const unsigned start = little_endian(bytes, 10, 4), header = little_endian(bytes, 14, 4);
  const int width = static_cast<int>(little_endian(bytes, 18, 4)),
            signed_height = static_cast<int>(little_endian(bytes, 22, 4));
  const unsigned bits = little_endian(bytes, 28, 2), compression = little_endian(bytes, 30, 4);
  const bool is_top_down = signed_height < 0;
  const auto rows = static_cast<std::size_t>(std::abs(static_cast<long>(signed_height)));
  if (header < 40 || width < 1 || !is_possible_image(static_cast<std::size_t>(width), rows, bytes.size())) return {};
  if ((bits != 8 && bits != 24 && bits != 32) || compression != 0) return {};
  const auto columns = static_cast<std::size_t>(width);
  const std::size_t stride = (columns * bits / 8 + 3) / 4 * 4, palette = 14 + header;
  if (start > bytes.size() || rows * stride > bytes.size() - start) return {};
  cv::Mat image(static_cast<int>(rows), width, CV_8UC3);
  for (std::size_t row = 0; row < rows; ++row) {
    const std::size_t from = start + (is_top_down ? row : rows - 1 - row) * stride;
    for (std::size_t col = 0; col < columns; ++col) {
      const std::size_t at =
          bits == 8 ? palette + 4 * static_cast<unsigned char>(bytes[from + col]) : from + col * bits / 8;
      auto& pixel = image.at<cv::Vec3b>(static_cast<int>(row), static_cast<int>(col));
      for (std::size_t i = 0; i < 3; ++i)
        pixel[static_cast<int>(i)] = static_cast<unsigned char>(little_endian(bytes, at + i, 1));
    }
  }
  if (bits != 8) return image;
  std::array<cv::Mat, 3> channels;
  cv::split(image, channels.data());
  const bool is_grey =
      cv::countNonZero(channels[0] != channels[1]) == 0 && cv::countNonZero(channels[0] != channels[2]) == 0;
  return is_grey ? channels[0] : image;
}

/// Next number of a PGM's or PPM's header, behind spaces and comments.
std::optional<int> header_number(std::string_view bytes, std::size_t& at) {
  while (at < bytes.size() && (std::isspace(static_cast<unsigned char>(bytes[at])) != 0 || bytes[at] == '#')) {
    if (bytes[at] == '#') {
      while (at < bytes.size() && bytes[at] != '\n') ++at;
    } else {
      ++at;
    }
  }
  int value = 0;
  const auto [end, error] = std::from_chars(bytes.data() + at, bytes.data() + bytes.size(), value);
  if (error != std::errc{}) return std::nullopt;
  at = static_cast<std::size_t>(end - bytes.data());
  return value;
}

/// Binary PGM (P5) and PPM (P6), 8 or 16 bit.
cv::Mat decode_pnm(std::string_view bytes) {
  std::size_t at = 2;
  const auto width = header_number(bytes, at), height = header_number(bytes, at), most = header_number(bytes, at);
  if (!width || !height || !most || *width < 1 || *height < 1 || *most < 1 || *most > 65535) return {};
  if (!is_possible_image(static_cast<std::size_t>(*width), static_cast<std::size_t>(*height), bytes.size())) return {};
  ++at;  // one space
  const int channels = bytes[1] == '6' ? 3 : 1;
  cv::Mat image(*height, *width, CV_MAKETYPE(*most > 255 ? CV_16U : CV_8U, channels));
  const std::size_t size = image.total() * image.elemSize();
  if (at > bytes.size() || size > bytes.size() - at) return {};
  std::memcpy(image.data, bytes.data() + at, size);
  if (*most > 255) {  // high byte first
    for (std::size_t i = 0; i + 1 < size; i += 2) std::swap(image.data[i], image.data[i + 1]);
  }
  if (channels == 3) cv::cvtColor(image, image, cv::COLOR_RGB2BGR);
  return image;
}

}  // namespace

cv::Mat decode_image(std::string_view bytes, bool keep_alpha) {
  if (begins_with(bytes, "\xFF\xD8\xFF")) return decode_jpeg(bytes);
  if (begins_with(bytes, "\x89PNG")) return decode_png(bytes, keep_alpha);
  if (begins_with(bytes, "II") || begins_with(bytes, "MM")) return decode_tiff(bytes, keep_alpha);
  if (begins_with(bytes, "RIFF") && bytes.size() >= 12 && bytes.substr(8, 4) == "WEBP")
    return decode_webp(bytes, keep_alpha);
  if (begins_with(bytes, "BM")) return decode_bmp(bytes);
  if (begins_with(bytes, "P5") || begins_with(bytes, "P6")) return decode_pnm(bytes);
  return {};
}

std::string png_bytes(const cv::Mat& image) {
  const int channels = image.channels();
  const bool fits = (image.depth() == CV_8U || image.depth() == CV_16U) && !image.empty();
  std::string out;
  if (!fits || (channels != 1 && channels != 3 && channels != 4) || !write_png(image, out)) {
    throw std::invalid_argument("pixels of a kind that PNG cannot hold");
  }
  return out;
}

std::string jpeg_bytes(const cv::Mat& image, int quality) {
  unsigned char* out = nullptr;
  unsigned long size = 0;
  const bool fits = (image.type() == CV_8UC1 || image.type() == CV_8UC3) && !image.empty();
  const bool is_written = fits && write_jpeg(image, quality, out, size);
  std::string bytes(reinterpret_cast<const char*>(out), is_written ? size : 0);
  std::free(out);
  if (!is_written) throw std::invalid_argument("pixels of a kind that JPEG cannot hold");
  return bytes;
}

}  // namespace alidade
