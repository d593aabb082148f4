#pragma once

#include <optional>
#include <string_view>

namespace alidade::report {

struct JpegSize {
  int width_px = 0, height_px = 0;
};

/// Width and height in the frame header of a JPEG, nothing if there is none. ITU-T T.81, B.2.2.
[[nodiscard]] std::optional<JpegSize> jpeg_size(std::string_view bytes);

}  // namespace alidade::report
