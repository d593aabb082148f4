#include "python/bindings/ending.h"

#include <unistd.h>

#include <chrono>
#include <mutex>
#include <thread>

namespace alidade::python {
namespace {

/// Who lives without the GIL, and whether Python ends.
struct End {
  std::mutex mutex;
  int num_released = 0;
  bool has_begun = false;
  std::thread::id ends_in;  ///< Once it has begun.

  void count(int change) {
    const std::scoped_lock lock(mutex);
    num_released += change;
  }
  void begin() {
    const std::scoped_lock lock(mutex);
    has_begun = true;
    ends_in = std::this_thread::get_id();
  }
  [[nodiscard]] bool is_for_others() {
    const std::scoped_lock lock(mutex);
    return has_begun && ends_in != std::this_thread::get_id();
  }
  [[nodiscard]] bool has_released() {
    const std::scoped_lock lock(mutex);
    return num_released > 0;
  }
};

/// Never destroyed: threads that stay look at it until the process ends.
End& the_end() {
  static auto* const end = new End;
  return *end;
}

[[noreturn]] void stay() {
  for (;;) std::this_thread::sleep_for(std::chrono::hours(1));
}

void stay_after_the_end() {
  if (!the_end().is_for_others()) return;
  the_end().count(-1);
  stay();
}

void end_python(const std::function<void()>& stop, const std::function<void()>& join, pid_t process) {
  the_end().begin();
  if (getpid() != process) return;
  stop();
  PyThreadState* const thread = PyEval_SaveThread();
  join();
  while (the_end().has_released()) std::this_thread::sleep_for(std::chrono::milliseconds(1));
  PyEval_RestoreThread(thread);
}

}  // namespace

Released::Released() : thread_(nullptr) {
  the_end().count(1);
  thread_ = PyEval_SaveThread();
  stay_after_the_end();
}

/// Python cannot end between the question and the answer: it waits for who is counted.
Released::~Released() {
  stay_after_the_end();
  PyEval_RestoreThread(thread_);
  the_end().count(-1);
}

py::object called(const py::object& function, const py::tuple& args) {
  PyObject* answer = nullptr;
  try {
    answer = PyObject_Call(function.ptr(), args.ptr(), nullptr);
  } catch (...) {  // no exception: the unwinding of pthread_exit
    stay();
  }
  if (answer == nullptr) throw py::error_already_set();
  return py::reinterpret_steal<py::object>(answer);
}

void at_end(const std::function<void()>& stop, const std::function<void()>& join) {
  const pid_t process = getpid();
  const auto end = [stop, join, process] { end_python(stop, join, process); };
  py::module_::import("atexit").attr("register")(py::cpp_function(end));
}

}  // namespace alidade::python
