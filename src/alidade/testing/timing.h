#pragma once

#include "alidade/geometry/sanitizers.h"

namespace alidade::testing {

/// Whether a time that is measured says anything of what users run: not with sanitizers, nor in a build for debugging.
/// Tests themselves are compiled without optimisation.
#ifdef NDEBUG
inline constexpr bool times_count = ALIDADE_IS_SANITIZED == 0;
#else
inline constexpr bool times_count = false;
#endif

}  // namespace alidade::testing
