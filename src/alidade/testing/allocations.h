#pragma once

#include <cstddef>

namespace alidade::testing {

/// The number of allocations so far, by operator new or by Eigen. Only in test programs that hold
/// observe/allocations_test.cpp, which counts.
[[nodiscard]] std::size_t num_allocations();

}  // namespace alidade::testing
