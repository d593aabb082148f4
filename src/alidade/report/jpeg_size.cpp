#include "alidade/report/jpeg_size.h"

#include <cstddef>

namespace alidade::report {

std::optional<JpegSize> jpeg_size(std::string_view bytes) {
  const auto byte = [&](std::size_t at) { return static_cast<int>(static_cast<unsigned char>(bytes[at])); };
  const auto word = [&](std::size_t at) { return 256 * byte(at) + byte(at + 1); };
  if (bytes.size() < 4 || word(0) != 0xFFD8) return std::nullopt;
  for (std::size_t at = 2; at + 9 <= bytes.size() && byte(at) == 0xFF;) {
    const int marker = byte(at + 1);
    // Start of frame, except the tables that share its range of numbers.
    const bool is_frame = marker >= 0xC0 && marker <= 0xCF && marker != 0xC4 && marker != 0xC8 && marker != 0xCC;
    if (is_frame && word(at + 5) > 0 && word(at + 7) > 0) return JpegSize{word(at + 7), word(at + 5)};
    at += 2 + static_cast<std::size_t>(word(at + 2));
  }
  return std::nullopt;
}

}  // namespace alidade::report
