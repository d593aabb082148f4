#pragma once

#include <functional>
#include <memory>
#include <optional>

#include "alidade/estimation/progress.h"
#include "python/bindings/bindings.h"

namespace alidade::python {

/// Runs `work` on a thread of its own, without the GIL, while this one waits: Ctrl-C is answered within 0.1 s, and
/// `progress`, a Python callable of (what, done, total) or None, is called from here alone. Where it returns False
/// (Python's or numpy's), or raises, or Ctrl-C is pressed, the work is asked to stop and left behind: it owns all that
/// it uses. Where Python ends, all work is stopped before.
void wait_for(std::function<void(const Progress&)> work, const py::object& progress);

/// The same for work that has a value.
template <typename Value>
[[nodiscard]] Value value_of(std::function<Value(const Progress&)> work, const py::object& progress) {
  const auto value = std::make_shared<std::optional<Value>>();
  wait_for([work = std::move(work), value](const Progress& report) { *value = work(report); }, progress);
  return std::move(**value);
}

/// Keeps Python objects alive from a thread that has no GIL.
[[nodiscard]] std::shared_ptr<void> kept(py::object object);

}  // namespace alidade::python
