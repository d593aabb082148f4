#pragma once

#include <string>
#include <vector>

#include "alidade/description/field.h"

namespace alidade {

/// The code of a text that is one of these words.
[[nodiscard]] inline TextCode one_of(std::string& value, const std::vector<std::string>& words) {
  WordList<std::string> list;
  for (const std::string& word : words) list.emplace_back(word, word);
  return words_code(value, list);
}

}  // namespace alidade
