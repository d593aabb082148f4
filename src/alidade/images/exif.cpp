#include "alidade/images/exif.h"

#include <cstdint>

namespace alidade {
namespace {

std::uint32_t byte_at(std::string_view bytes, std::size_t i) { return static_cast<unsigned char>(bytes[i]); }

/// Whole numbers of a TIFF structure that begins at `start` of a file; 0 behind its end.
class Tiff {
 public:
  Tiff(std::string_view bytes, std::size_t start) : bytes_(bytes), start_(start) {
    if (start > bytes.size()) return;
    is_little_ = bytes_.substr(start, 4) == std::string_view("II*\0", 4);
    is_tiff_ = is_little_ || bytes_.substr(start, 4) == std::string_view("MM\0*", 4);
  }

  [[nodiscard]] bool is_tiff() const { return is_tiff_; }
  [[nodiscard]] bool is_little() const { return is_little_; }
  [[nodiscard]] std::size_t in_file(std::size_t at) const { return start_ + at; }
  [[nodiscard]] std::uint32_t number(std::size_t at, std::size_t num_bytes) const {
    if (start_ + at + num_bytes > bytes_.size()) return 0;
    std::uint32_t value = 0;
    for (std::size_t i = 0; i < num_bytes; ++i) {
      const std::size_t next = is_little_ ? num_bytes - 1 - i : i;
      value = (value << 8U) + byte_at(bytes_, start_ + at + next);
    }
    return value;
  }

 private:
  std::string_view bytes_;
  std::size_t start_;
  bool is_little_ = true, is_tiff_ = false;
};

/// Tags of the first directory.
ExifTags read_first_directory(const Tiff& tiff) {
  ExifTags tags;
  tags.little_endian = tiff.is_little();
  if (!tiff.is_tiff()) return tags;
  const std::size_t directory = tiff.number(4, 4), count = tiff.number(directory, 2);
  bool is_preview = false, has_more_inside = false;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t entry = directory + 2 + 12 * i;
    const std::uint32_t tag = tiff.number(entry, 2);
    if (tag == 0x0112) {
      const auto value = static_cast<int>(tiff.number(entry + 8, 2));
      if (value < 1 || value > 8) continue;
      tags.orientation = value;
      tags.orientation_at = tiff.in_file(entry + 8);
    }
    is_preview = is_preview || (tag == 0x00FE && (tiff.number(entry + 8, 4) & 1U) != 0);  // NewSubfileType
    has_more_inside = has_more_inside || tag == 0x014A;                                   // SubIFDs
    tags.is_raw = tags.is_raw || tag == 0xC612;                                           // DNGVersion
  }
  tags.is_raw = tags.is_raw || (is_preview && has_more_inside);
  return tags;
}

ExifTags read_jpeg(std::string_view bytes) {
  std::size_t at = 2;
  while (at + 10 <= bytes.size() && byte_at(bytes, at) == 0xFF && byte_at(bytes, at + 1) != 0xDA) {
    if (byte_at(bytes, at + 1) == 0xFF) {  // a fill byte
      ++at;
      continue;
    }
    const bool is_exif = byte_at(bytes, at + 1) == 0xE1 && bytes.substr(at + 4, 6) == std::string_view("Exif\0\0", 6);
    const std::size_t length = 256 * byte_at(bytes, at + 2) + byte_at(bytes, at + 3);
    // Only within its segment: what a broken directory points to behind it is image data.
    if (is_exif) return read_first_directory(Tiff(bytes.substr(0, at + 2 + length), at + 10));
    at += 2 + length;
  }
  return {};
}

ExifTags read_png(std::string_view bytes) {
  std::size_t at = 8;
  while (at + 12 <= bytes.size()) {
    std::size_t length = 0;
    for (std::size_t i = 0; i < 4; ++i) length = (length << 8U) + byte_at(bytes, at + i);
    const std::string_view kind = bytes.substr(at + 4, 4);
    if (kind == "eXIf") return read_first_directory(Tiff(bytes.substr(0, at + 8 + length), at + 8));
    at += 12 + length;
  }
  return {};
}

}  // namespace

ExifTags exif_tags(std::string_view bytes) {
  if (bytes.substr(0, 3) == "\xFF\xD8\xFF") return read_jpeg(bytes);
  if (bytes.substr(0, 4) == "\x89PNG") return read_png(bytes);
  return read_first_directory(Tiff(bytes, 0));
}

std::string_view how_turned(int orientation) {
  switch (orientation) {
    case 3:
      return "upside down";
    case 6:
    case 8:
      return "on its side";
    case 2:
    case 4:
    case 5:
    case 7:
      return "mirrored";
    default:
      return "";
  }
}

}  // namespace alidade
