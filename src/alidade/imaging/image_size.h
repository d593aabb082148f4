#pragma once

#include <cstddef>

namespace alidade {

/// Whether a file with this many bytes may contain an image of this size: more pixels mean a false header, or too large
/// an image, and no memory is allocated for them. A blank page compresses to one byte per 8000 pixels.
[[nodiscard]] inline bool is_possible_image(std::size_t width, std::size_t height, std::size_t num_bytes) {
  constexpr std::size_t max_side = 1u << 20, max_pixels = 1u << 30, max_pixels_per_byte = 1u << 14;
  return width >= 1 && height >= 1 && width <= max_side && height <= max_side && width * height <= max_pixels &&
         width * height / max_pixels_per_byte <= num_bytes;
}

}  // namespace alidade
