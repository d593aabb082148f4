#pragma once

namespace alidade::testing {

/// Whether a time that is measured says anything of what users run: not with sanitizers, nor without optimisation.
inline constexpr bool times_count =
#if !defined(__OPTIMIZE__) || defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    false;
#else
    true;
#endif

}  // namespace alidade::testing
