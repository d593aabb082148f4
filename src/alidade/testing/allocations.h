#pragma once

#include <cstddef>

namespace alidade::testing {

/// How often malloc was asked for memory so far, by operator new or by Eigen. Only in test programs that hold
/// observe/allocations_test.cpp, which counts.
[[nodiscard]] std::size_t num_allocations();

}  // namespace alidade::testing
