#pragma once

#include <cstddef>
#include <string_view>

namespace alidade {

/// Metadata of an image file beside its pixels.
struct ExifTags {
  /// How a viewer rotates the stored pixels: 1 not at all, 3 upside down, 6 and 8 by a quarter turn, 2 4 5 7 mirrored;
  /// 0 if the file does not say. CIPA DC-008 (Exif 2.32), tag 0x0112.
  int orientation = 0;
  /// Offset of the orientation's two bytes in the file, and whether the lower one is first; valid only if the
  /// orientation is given.
  std::size_t orientation_at = 0;
  bool little_endian = true;
  bool is_raw = false;  ///< A TIFF that is a camera's raw file (DNG, or its first image is a reduced preview).
};

/// Tags of a JPEG (APP1 segment), a TIFF or a PNG (eXIf chunk), from its bytes; empty for any other file, or if the
/// tags are broken.
[[nodiscard]] ExifTags exif_tags(std::string_view bytes);

/// How the camera was held, by the orientation: "upside down", "on its side"; empty for 0 and 1.
[[nodiscard]] std::string_view how_turned(int orientation);

}  // namespace alidade
