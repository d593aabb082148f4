#pragma once

#include <cstddef>
#include <string_view>

namespace alidade {

/// What an image file says of itself beside its pixels.
struct ExifTags {
  /// How a viewer is to rotate the stored pixels: 1 as they are, 3 upside down, 6 and 8 a quarter turn, 2 4 5 7
  /// mirrored; 0 where the file does not say. CIPA DC-008 (Exif 2.32), tag 0x0112.
  int orientation = 0;
  /// Where the orientation's two bytes stand in the file, and whether the lower comes first; meaningful where it is
  /// given.
  std::size_t orientation_at = 0;
  bool little_endian = true;
  bool is_raw = false;  ///< A TIFF that is a camera's raw file (DNG, or its first image a reduced preview).
};

/// Of a JPEG (APP1 segment), a TIFF or a PNG (eXIf chunk), from its bytes; empty for anything else, or where the
/// tags are broken.
[[nodiscard]] ExifTags exif_tags(std::string_view bytes);

/// "upside down", "on its side": how the camera was held by its orientation; empty for 0 and 1.
[[nodiscard]] std::string_view how_turned(int orientation);

}  // namespace alidade
