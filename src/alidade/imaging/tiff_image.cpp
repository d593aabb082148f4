#include "alidade/imaging/tiff_image.h"

#include <fmt/format.h>
#include <tiffio.h>

#include <algorithm>
#include <cstring>
#include <memory>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <vector>

#include "alidade/imaging/image_size.h"

namespace alidade {
namespace {

/// The file in memory, as libtiff reads it.
struct TiffSource {
  std::string_view bytes;
  toff_t at = 0;
};

TiffSource& source_of(thandle_t handle) { return *static_cast<TiffSource*>(handle); }

tmsize_t read_part(thandle_t handle, void* out, tmsize_t size) {
  TiffSource& source = source_of(handle);
  const toff_t left = source.bytes.size() - std::min<toff_t>(source.at, source.bytes.size());
  const auto count = static_cast<tmsize_t>(std::min<toff_t>(left, static_cast<toff_t>(size)));
  std::memcpy(out, source.bytes.data() + source.at, static_cast<std::size_t>(count));
  source.at += static_cast<toff_t>(count);
  return count;
}

tmsize_t write_nothing(thandle_t, void*, tmsize_t) { return 0; }

toff_t seek_to(thandle_t handle, toff_t offset, int whence) {
  TiffSource& source = source_of(handle);
  if (whence == SEEK_SET) source.at = offset;
  if (whence == SEEK_CUR) source.at += offset;
  if (whence == SEEK_END) source.at = source.bytes.size() + offset;
  return source.at;
}

int close_nothing(thandle_t) { return 0; }
toff_t size_of_file(thandle_t handle) { return source_of(handle).bytes.size(); }

/// The caller reports what libtiff would print.
void silence() {
  static const bool once = [] {
    TIFFSetErrorHandler(nullptr);
    TIFFSetWarningHandler(nullptr);
    return true;
  }();
  (void)once;
}

struct TiffCloser {
  void operator()(TIFF* tiff) const { TIFFClose(tiff); }
};

struct TiffShape {
  std::uint32_t width = 0, height = 0;
  std::uint16_t bits = 1, samples = 1, photometric = PHOTOMETRIC_MINISBLACK, planes = PLANARCONFIG_CONTIG;
  std::uint16_t format = SAMPLEFORMAT_UINT;
};

TiffShape shape_of(TIFF* tiff) {
  TiffShape shape;
  TIFFGetField(tiff, TIFFTAG_IMAGEWIDTH, &shape.width);
  TIFFGetField(tiff, TIFFTAG_IMAGELENGTH, &shape.height);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_BITSPERSAMPLE, &shape.bits);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLESPERPIXEL, &shape.samples);
  TIFFGetField(tiff, TIFFTAG_PHOTOMETRIC, &shape.photometric);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_PLANARCONFIG, &shape.planes);
  TIFFGetFieldDefaulted(tiff, TIFFTAG_SAMPLEFORMAT, &shape.format);
  return shape;
}

/// Whether room can be made for it: libtiff makes room for a whole strip or tile of all samples.
bool is_possible_shape(TIFF* tiff, const TiffShape& shape, std::size_t num_bytes) {
  constexpr std::uint16_t max_samples = 8;
  constexpr std::uint64_t max_block_bytes = std::uint64_t{1} << 32, smallest_bytes = 1u << 24;
  if (!is_possible_image(shape.width, shape.height, num_bytes) || shape.samples > max_samples || shape.bits > 32)
    return false;
  const std::uint64_t image_bytes = std::uint64_t{shape.width} * shape.height * shape.samples * shape.bits / 8;
  const std::uint64_t block_bytes = TIFFIsTiled(tiff) != 0 ? TIFFTileSize64(tiff) : TIFFStripSize64(tiff);
  return block_bytes <= std::min(max_block_bytes, 4 * image_bytes + smallest_bytes);
}

bool is_grey(const TiffShape& shape) {
  return shape.photometric == PHOTOMETRIC_MINISBLACK || shape.photometric == PHOTOMETRIC_MINISWHITE;
}

/// Grey, RGB or RGBA in rows, as cameras write it: read as it is.
cv::Mat read_rows(TIFF* tiff, const TiffShape& shape, bool keep_alpha) {
  const int depth = shape.bits == 16 ? CV_16U : CV_8U;
  cv::Mat image(static_cast<int>(shape.height), static_cast<int>(shape.width), CV_MAKETYPE(depth, shape.samples));
  if (static_cast<std::size_t>(TIFFScanlineSize(tiff)) > static_cast<std::size_t>(image.cols) * image.elemSize())
    return {};
  for (int row = 0; row < image.rows; ++row) {
    if (TIFFReadScanline(tiff, image.ptr(row), static_cast<std::uint32_t>(row)) < 0) return {};
  }
  if (shape.photometric == PHOTOMETRIC_MINISWHITE) cv::bitwise_not(image, image);
  if (shape.samples == 2) cv::extractChannel(image, image, 0);
  if (shape.samples == 3) cv::cvtColor(image, image, cv::COLOR_RGB2BGR);
  if (shape.samples == 4) cv::cvtColor(image, image, keep_alpha ? cv::COLOR_RGBA2BGRA : cv::COLOR_RGBA2BGR);
  return image;
}

/// Everything else (palettes, tiles, planes, inks, one bit): libtiff's own way to colours of 8 bit.
cv::Mat read_colours(TIFF* tiff, const TiffShape& shape, bool keep_alpha) {
  cv::Mat rgba(static_cast<int>(shape.height), static_cast<int>(shape.width), CV_8UC4), image;
  const int ok = TIFFReadRGBAImageOriented(tiff, shape.width, shape.height, reinterpret_cast<std::uint32_t*>(rgba.data),
                                           ORIENTATION_TOPLEFT, 0);
  if (ok == 0) return {};
  if (is_grey(shape)) {
    cv::extractChannel(rgba, image, 0);
  } else {
    const bool alpha = keep_alpha && shape.samples == 4;
    cv::cvtColor(rgba, image, alpha ? cv::COLOR_RGBA2BGRA : cv::COLOR_RGBA2BGR);
  }
  return image;
}

using OpenTiff = std::unique_ptr<TIFF, TiffCloser>;

OpenTiff opened(TiffSource& source) {
  silence();
  return OpenTiff(TIFFClientOpen("picture", "rm", &source, read_part, write_nothing, seek_to, close_nothing,
                                 size_of_file, nullptr, nullptr));
}

}  // namespace

std::string foreign_numbers(std::string_view bytes) {
  if (!bytes.starts_with("II") && !bytes.starts_with("MM")) return {};
  TiffSource source{bytes};
  const OpenTiff tiff = opened(source);
  if (!tiff) return {};
  const TiffShape shape = shape_of(tiff.get());
  const bool is_float = shape.format == SAMPLEFORMAT_IEEEFP;
  if (!is_float && shape.format == SAMPLEFORMAT_UINT && shape.bits <= 16) return {};
  return fmt::format("a TIFF of {}-bit {} numbers: save it with 8 or 16 bits", shape.bits,
                     is_float ? "floating-point" : "whole");
}

cv::Mat decode_tiff(std::string_view bytes, bool keep_alpha) {
  TiffSource source{bytes};
  const OpenTiff tiff = opened(source);
  if (!tiff) return {};
  const TiffShape shape = shape_of(tiff.get());
  if (shape.format != SAMPLEFORMAT_UINT || !is_possible_shape(tiff.get(), shape, bytes.size())) return {};
  const bool is_plain =
      (shape.bits == 8 || shape.bits == 16) && shape.planes == PLANARCONFIG_CONTIG && TIFFIsTiled(tiff.get()) == 0 &&
      (is_grey(shape) ? shape.samples <= 2
                      : shape.photometric == PHOTOMETRIC_RGB && shape.samples >= 3 && shape.samples <= 4);
  if (is_plain) return read_rows(tiff.get(), shape, keep_alpha);
  return shape.bits == 16 ? cv::Mat() : read_colours(tiff.get(), shape, keep_alpha);
}

}  // namespace alidade
