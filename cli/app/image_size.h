#pragma once

#include <string>
#include <utility>

namespace alidade::cli {

/// Width and height of "800x600". Throws UsageError.
[[nodiscard]] std::pair<int, int> image_size(const std::string& text);

}  // namespace alidade::cli
