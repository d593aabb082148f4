#pragma once

#include <string_view>

namespace alidade {

/// Natural order, a2 before a10: runs of digits are compared as numbers.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

}  // namespace alidade
