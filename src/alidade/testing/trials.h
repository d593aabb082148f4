#pragma once

#include <algorithm>
#include <cstdlib>

namespace alidade::testing {

/// How many draws a test takes: `few` where every change is tested, ALIDADE_TEST_TRIALS where more are requested
/// (ALIDADE_TEST_TRIALS=20 ctest -R Faults). Bounds on shares are to widen by the number that was drawn.
[[nodiscard]] inline int trials(int few) {
  const char* const wanted = std::getenv("ALIDADE_TEST_TRIALS");
  return wanted != nullptr ? std::max(1, std::atoi(wanted)) : few;
}

}  // namespace alidade::testing
