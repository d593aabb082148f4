#pragma once

#include <functional>

#include "python/bindings/bindings.h"

/// The end of Python, which a daemon thread may meet at work. Where such a thread takes the GIL after that, CPython
/// ends it by pthread_exit, whose unwinding does not pass destructors: the process would abort.
namespace alidade::python {

/// Without the GIL as long as it lives. A thread stays in it for good where Python ends meanwhile in another one.
class Released {
 public:
  Released();
  ~Released();
  Released(const Released&) = delete;
  Released& operator=(const Released&) = delete;

 private:
  PyThreadState* thread_;
};

/// What a call into Python gives, as PyObject_Call does; a thread that Python ends amid it stays for good.
[[nodiscard]] py::object called(const py::object& function, const py::tuple& args);

/// Has Python call it before it ends: `stop` asks all work to stop; then the GIL is free until every thread that lives
/// without it has come back or stays, and until `join` has come back. A forked child, which has none of the threads,
/// calls neither.
void at_end(const std::function<void()>& stop, const std::function<void()>& join);

}  // namespace alidade::python
