#pragma once

#include <stdexcept>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A config, or values, that cannot be: a misspelt model, a corner that the board does not have. Thrown before any work
/// by the jobs of the public headers, with every fault in one sentence. The command line ends in exit code 2 with it.
struct ConfigError : std::invalid_argument {
  using std::invalid_argument::invalid_argument;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
