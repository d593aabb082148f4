#pragma once

#include <string>
#include <vector>

namespace alidade {

/// Names in one line, a word before their numbers once: "view 3, 8, 13".
[[nodiscard]] std::string name_list(const std::vector<std::string>& names);

}  // namespace alidade
