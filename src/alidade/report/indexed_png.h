#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "alidade/report/colours.h"

namespace alidade::report {

/// A small PNG of palette indices, row-major; index 255 is transparent. Stored, not compressed: maps are a few KB.
/// W3C, Portable Network Graphics, 2003; Deutsch, RFC 1950 and 1951.
[[nodiscard]] std::string indexed_png(int cols, int rows, const std::vector<std::uint8_t>& indices,
                                      const std::vector<Rgb>& palette);

inline constexpr std::uint8_t transparent_index = 255;

}  // namespace alidade::report
