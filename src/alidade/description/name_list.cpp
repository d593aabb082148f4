#include "alidade/description/name_list.h"

#include <string_view>

namespace alidade {
namespace {

/// "view " of "view 3"; empty where the name is not of a word and a number.
std::string_view word_of(std::string_view name) {
  const std::size_t at = name.find(' ');
  const bool has_number = at != std::string_view::npos && at + 1 < name.size() &&
                          name.find_first_not_of("0123456789", at + 1) == std::string_view::npos;
  return has_number ? name.substr(0, at + 1) : std::string_view();
}

}  // namespace

std::string name_list(const std::vector<std::string>& names) {
  std::string text;
  std::string_view word;
  for (const std::string& name : names) {
    const std::string_view own = word_of(name);
    text += (text.empty() ? "" : ", ") + name.substr(own == word ? own.size() : 0);
    word = own;
  }
  return text;
}

}  // namespace alidade
