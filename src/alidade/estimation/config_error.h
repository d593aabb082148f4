#pragma once

#include <stdexcept>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// An invalid config, or invalid values: a misspelt model, a corner that the board does not have. The functions of the
/// public headers throw it before any work, with every fault in one sentence. The command line then ends with exit code
/// 2.
struct ConfigError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

/// Throws a ConfigError that lists all these faults, if there are any.
inline void require_none(const std::vector<std::string>& faults) {
  std::string sentence;
  for (const std::string& each : faults) sentence += (sentence.empty() ? "" : "; ") + each;
  if (!sentence.empty()) throw ConfigError(sentence);
}

ALIDADE_PUBLIC_END
}  // namespace alidade
