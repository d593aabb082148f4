#include "alidade/files/json_value.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <new>

#include "alidade/geometry/sanitizers.h"

// The sanitizers have put their own allocations in place.
#if !ALIDADE_IS_SANITIZED

namespace {

int allocations_left = -1;  // until one fails; < 0: none does

void* allocate(std::size_t bytes) {
  if (allocations_left >= 0 && allocations_left-- == 0) throw std::bad_alloc();
  void* const place = std::malloc(bytes);
  if (place == nullptr) throw std::bad_alloc();
  return place;
}

}  // namespace

void* operator new(std::size_t bytes) { return allocate(bytes); }
void* operator new[](std::size_t bytes) { return allocate(bytes); }
void operator delete(void* place) noexcept { std::free(place); }
void operator delete[](void* place) noexcept { std::free(place); }
void operator delete(void* place, std::size_t) noexcept { std::free(place); }
void operator delete[](void* place, std::size_t) noexcept { std::free(place); }

namespace alidade {
namespace {

/// Whichever allocation of it fails, a copy ends with that alone.
TEST(JsonValue, ACopyThatFindsNoMemoryDestroysNothingThatWasNotMade) {
  const JsonValue::List inner{JsonValue(std::vector<double>{1.0, 2.0}), JsonValue("a text that has room of its own"),
                              JsonValue(JsonValue::List{JsonValue(1.0), JsonValue(std::vector<double>{3.0})})};
  JsonValue value = JsonValue::object();
  value["first"] = JsonValue(inner);
  value["second"] = JsonValue(inner);
  int failed = 0;
  for (bool is_copied = false; !is_copied; ++failed) {
    allocations_left = failed;
    try {
      const JsonValue copy = value;
      is_copied = true;
    } catch (const std::bad_alloc&) {
    }
    allocations_left = -1;
  }
  EXPECT_GT(failed, 8);
}

}  // namespace
}  // namespace alidade

#endif
