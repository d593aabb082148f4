#pragma once

#include <string>
#include <vector>

namespace alidade {

/// Joins names in one line, with a common word only once before their numbers: "view 3, 8, 13".
[[nodiscard]] std::string name_list(const std::vector<std::string>& names);

}  // namespace alidade
