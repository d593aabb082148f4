#pragma once

#include <memory>
#include <mutex>
#include <utility>

#include "python/bindings/bindings.h"
#include "python/bindings/ending.h"

namespace alidade::python {

/// A value that several threads of a program may use, one after the other.
template <class Value>
class Guarded {
 public:
  template <class... Args>
  explicit Guarded(Args&&... args) : value_(std::forward<Args>(args)...) {}

  /// From Python: other threads run meanwhile. `work` touches no Python object.
  template <class Work>
  auto from_python(const Work& work) {
    const Released released;
    return from_work(work);
  }
  /// From a thread without the GIL.
  template <class Work>
  auto from_work(const Work& work) {
    const std::scoped_lock lock(mutex_);
    return work(value_);
  }

 private:
  std::mutex mutex_;
  Value value_;
};

template <class Value>
using GuardedPtr = std::shared_ptr<Guarded<Value>>;

}  // namespace alidade::python
