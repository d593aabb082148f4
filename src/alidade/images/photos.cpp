#include "alidade/images/photos.h"

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "alidade/description/natural_order.h"
#include "alidade/images/exif.h"
#include "alidade/images/foreign_images.h"
#include "alidade/imaging/image_codecs.h"
#include "alidade/imaging/tiff_image.h"

namespace alidade {
namespace {

bool looks_like_a_photo(const std::filesystem::path& file) {
  static const std::vector<std::string> endings = {".jpg", ".jpeg", ".png", ".tif", ".tiff",
                                                   ".bmp", ".pgm",  ".ppm", ".webp"};
  return std::find(endings.begin(), endings.end(), lower_ending(file)) != endings.end();
}

bool starts_with(std::string_view bytes, std::string_view magic) { return bytes.substr(0, magic.size()) == magic; }

/// Where a JPEG's image data begin, behind its headers: a thumbnail in them has an end marker of its own.
std::size_t jpeg_data_start(std::string_view bytes) {
  const auto byte = [&](std::size_t i) { return static_cast<std::size_t>(static_cast<unsigned char>(bytes[i])); };
  std::size_t at = 2;
  while (at + 4 <= bytes.size() && byte(at) == 0xFF && byte(at + 1) != 0xDA) {
    at += byte(at + 1) == 0xFF ? 1 : 2 + 256 * byte(at + 2) + byte(at + 3);  // fill bytes; segments
  }
  return std::min(at, bytes.size());
}

/// A PGM or PPM of fewer bytes than its header announces values: decoders would make room for them all.
bool is_short_netpbm(std::string_view bytes) {
  if (bytes.size() < 2 || bytes[0] != 'P' || std::string_view("2356").find(bytes[1]) == std::string_view::npos)
    return false;
  double values = bytes[1] == '3' || bytes[1] == '6' ? 3.0 : 1.0;
  std::size_t at = 2;
  for (int side = 0; side < 2; ++side) {
    const auto is_digit = [&] { return bytes[at] >= '0' && bytes[at] <= '9'; };
    for (; at < bytes.size() && !is_digit(); ++at)
      if (bytes[at] == '#') at = std::min(bytes.find('\n', at), bytes.size() - 1);
    double length = 0.0;
    for (; at < bytes.size() && is_digit(); ++at) length = 10.0 * length + (bytes[at] - '0');
    values *= length;
  }
  return static_cast<double>(bytes.size()) < values;
}

/// A JPEG has its end marker, and a PNG its IEND chunk: without it the file was cut off, and decoders would fill the
/// rest with grey. What stands behind them (some phones append a video) is no matter.
bool is_cut_off(std::string_view bytes) {
  if (is_short_netpbm(bytes)) return true;
  if (starts_with(bytes, "\xFF\xD8\xFF")) {
    return bytes.find("\xFF\xD9", jpeg_data_start(bytes)) == std::string_view::npos;
  }
  constexpr std::size_t stray = 64 * 1024;
  const std::string_view tail = bytes.substr(bytes.size() > stray ? bytes.size() - stray : 0);
  return starts_with(bytes, "\x89PNG") && tail.rfind("IEND") == std::string_view::npos;
}

/// A TIFF whose orientation tag asks for rotation, with that tag reset: libtiff rotates when it converts colours.
/// Empty: unchanged.
std::string untagged_tiff(std::string_view bytes) {
  if (!starts_with(bytes, "II*") && !starts_with(bytes, "MM")) return "";
  const ExifTags tags = exif_tags(bytes);
  if (tags.orientation < 2) return "";
  std::string stored(bytes);
  stored[tags.orientation_at] = static_cast<char>(tags.little_endian ? 1 : 0);
  stored[tags.orientation_at + 1] = static_cast<char>(tags.little_endian ? 0 : 1);
  return stored;
}

/// The images of a folder in natural order; what else lies there is named in `skipped`.
std::vector<std::filesystem::path> photos_in(const std::filesystem::path& folder, std::vector<SkippedInput>& skipped) {
  std::vector<std::filesystem::path> inside, others;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator(folder, error)) {
    (looks_like_a_photo(entry.path()) ? inside : others).push_back(entry.path());
  }
  if (error) throw InputError(folder.string() + ": cannot be read: " + error.message());
  sort_naturally(inside);
  sort_naturally(others);
  const std::set<std::string> own = our_results(folder);
  const std::size_t before = skipped.size();
  for (const auto& other : others) {
    const std::string name = other.filename().string();
    if (name.starts_with(".") || own.contains(name)) continue;
    if (std::string reason = why_no_photo(other); !reason.empty()) skipped.push_back({name, 0, std::move(reason)});
  }
  if (!inside.empty()) return inside;
  std::string what = folder.string() + ": the folder holds no photos";
  if (skipped.size() > before) what += "; " + skipped[before].file + " " + skipped[before].reason;
  throw InputError(what);
}

}  // namespace

bool looks_like_photos(const std::filesystem::path& argument) {
  std::error_code ignored;
  return std::filesystem::is_directory(argument, ignored) || looks_like_a_photo(argument) ||
         is_foreign_ending(argument);
}

void sort_naturally(std::vector<std::filesystem::path>& files) {
  std::ranges::sort(files, [](const auto& a, const auto& b) { return natural_less(a.string(), b.string()); });
}

PhotoFiles find_photos(const std::vector<std::filesystem::path>& arguments) {
  PhotoFiles found;
  for (const auto& argument : arguments) {
    std::error_code error;
    if (!std::filesystem::exists(argument, error)) {
      throw InputError(argument.string() + ": no such file or folder");
    }
    if (!std::filesystem::is_directory(argument, error)) {
      found.photos.push_back(argument);
      continue;
    }
    const auto inside = photos_in(argument, found.skipped);
    found.photos.insert(found.photos.end(), inside.begin(), inside.end());
  }
  return found;
}

std::vector<std::filesystem::path> list_photos(const std::vector<std::filesystem::path>& arguments) {
  return find_photos(arguments).photos;
}

cv::Mat decode_photo(std::string_view bytes) {
  if (bytes.empty()) throw InputError("the file is empty");
  if (const std::string foreign = foreign_image(bytes); !foreign.empty()) throw InputError(foreign);
  if (is_cut_off(bytes)) throw InputError("the image is cut off");
  const std::string as_stored = untagged_tiff(bytes);
  if (!as_stored.empty()) bytes = as_stored;
  cv::Mat photo = decode_image(bytes);
  if (photo.empty()) {
    const std::string numbers = foreign_numbers(bytes);
    throw InputError(numbers.empty() ? "not an image that can be read" : numbers);
  }
  return photo;
}

cv::Mat decode_photo(std::string_view bytes, const std::string& file) {
  try {
    return decode_photo(bytes);
  } catch (const InputError& error) {
    throw InputError(file + ": " + error.what());
  }
}

std::string jpeg_preview(const cv::Mat& photo, int max_width_px, int quality) {
  cv::Mat small = photo;
  if (photo.cols > max_width_px) {
    const double scale = static_cast<double>(max_width_px) / photo.cols;
    cv::resize(photo, small, {}, scale, scale, cv::INTER_AREA);
  }
  if (small.depth() == CV_16U) small.convertTo(small, CV_8U, 1.0 / 257.0);
  if (small.depth() != CV_8U) small.convertTo(small, CV_8U);
  if (small.channels() == 3) cv::cvtColor(small, small, cv::COLOR_BGR2GRAY);
  if (small.channels() == 4) cv::cvtColor(small, small, cv::COLOR_BGRA2GRAY);
  return jpeg_bytes(small, quality);
}

}  // namespace alidade
