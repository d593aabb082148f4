#pragma once

#include <string_view>

namespace alidade {

/// a2 before a10: runs of digits compare as numbers.
[[nodiscard]] bool natural_less(std::string_view a, std::string_view b);

}  // namespace alidade
