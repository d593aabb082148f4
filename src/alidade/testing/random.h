#pragma once

#include <cstdlib>
#include <random>
#include <string>

namespace alidade::testing {

/// Seeded generator for tests. Same seed, same run; `ALIDADE_TEST_SEED=7 ctest` explores another draw.
[[nodiscard]] inline std::mt19937_64 make_rng() {
  const char* seed = std::getenv("ALIDADE_TEST_SEED");
  return std::mt19937_64(seed ? std::stoull(seed) : 1u);
}

}  // namespace alidade::testing
