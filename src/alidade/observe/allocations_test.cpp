#include "alidade/testing/allocations.h"

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <atomic>
#include <cstdlib>
#include <memory>

#include "alidade/geometry/sanitizers.h"

// Eigen calls malloc past operator new, so malloc itself is counted: by the sanitizers' hook where they have put theirs
// in its place, otherwise around glibc's.
namespace {

std::atomic<std::size_t> count{0};

}  // namespace

#if ALIDADE_IS_SANITIZED

extern "C" int __sanitizer_install_malloc_and_free_hooks(void (*on_malloc)(const volatile void*, std::size_t),
                                                         void (*on_free)(const volatile void*));

namespace {

const int hooks_installed = __sanitizer_install_malloc_and_free_hooks(
    [](const volatile void*, std::size_t) { ++count; }, [](const volatile void*) {});

}  // namespace

#else

extern "C" {

void* __libc_malloc(std::size_t bytes);

void* malloc(std::size_t bytes) {
  ++count;
  return __libc_malloc(bytes);
}
}

#endif

namespace alidade::testing {
namespace {

TEST(Allocations, AreCountedWhoeverAsks) {
  const std::size_t before = num_allocations();
  const auto by_new = std::make_unique<double>(1.0);
  const std::size_t after_new = num_allocations();
  const Eigen::VectorXd by_eigen = Eigen::VectorXd::Constant(100, *by_new);
  EXPECT_GT(after_new, before);
  EXPECT_GT(num_allocations(), after_new);
  EXPECT_EQ(by_eigen.sum(), 100.0);
}

}  // namespace

std::size_t num_allocations() { return count; }

}  // namespace alidade::testing
