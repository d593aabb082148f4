#include "python/bindings/waiting.h"

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <list>
#include <mutex>
#include <thread>

#include "python/bindings/ending.h"

namespace alidade::python {
namespace {

/// What the thread that works and the one that waits share.
struct Shared {
  std::mutex mutex;
  std::condition_variable ended;
  bool is_done = false;
  std::exception_ptr thrown;
  std::atomic<bool> stops = false;
  bool has_news = false;
  std::string what;
  std::size_t done = 0, total = 0;

  /// Called by the work, from any of its threads.
  bool report(std::string_view now, std::size_t so_far, std::size_t of) {
    const std::scoped_lock lock(mutex);
    what = now;
    done = so_far;
    total = of;
    has_news = true;
    return !stops;
  }
  void end(std::exception_ptr error) {
    const std::scoped_lock lock(mutex);
    is_done = true;
    thrown = std::move(error);
    ended.notify_all();
  }
};

/// All work, and the threads of that for which nobody waits any more: it ends soon, and before Python does.
struct Begun {
  std::mutex mutex;
  std::list<std::weak_ptr<Shared>> all;
  std::list<std::pair<std::shared_ptr<Shared>, std::thread>> left_behind;
};

/// Never destroyed: threads may outlive the end of Python.
Begun& begun() {
  static auto* const it = new Begun;
  return *it;
}

bool has_ended(const std::shared_ptr<Shared>& shared) {
  const std::scoped_lock lock(shared->mutex);
  return shared->is_done;
}

std::shared_ptr<Shared> begun_work() {
  auto shared = std::make_shared<Shared>();
  const std::scoped_lock lock(begun().mutex);
  begun().all.remove_if([](const std::weak_ptr<Shared>& each) { return each.expired(); });
  begun().all.push_back(shared);
  return shared;
}

void leave_behind(const std::shared_ptr<Shared>& shared, std::thread thread) {
  shared->stops = true;
  const std::scoped_lock lock(begun().mutex);
  auto& left = begun().left_behind;
  for (auto each = left.begin(); each != left.end();) {
    if (!has_ended(each->first)) {
      ++each;
      continue;
    }
    each->second.join();
    each = left.erase(each);
  }
  left.emplace_back(shared, std::move(thread));
}

std::vector<std::shared_ptr<Shared>> all_work() {
  const std::scoped_lock lock(begun().mutex);
  std::vector<std::shared_ptr<Shared>> work;
  for (const std::weak_ptr<Shared>& each : begun().all) {
    if (auto shared = each.lock()) work.push_back(std::move(shared));
  }
  return work;
}

void stop_all() {
  for (const auto& shared : all_work()) shared->stops = true;
}

void join_all() {
  for (const auto& shared : all_work()) {
    std::unique_lock lock(shared->mutex);
    shared->ended.wait(lock, [&] { return shared->is_done; });
  }
  std::list<std::pair<std::shared_ptr<Shared>, std::thread>> left;
  {
    const std::scoped_lock lock(begun().mutex);
    left.swap(begun().left_behind);
  }
  for (auto& [shared, thread] : left) thread.join();
}

/// Whether it is over; waits a moment. The GIL is free meanwhile.
bool wait_a_moment(Shared& shared) {
  const Released released;
  std::unique_lock lock(shared.mutex);
  return shared.ended.wait_for(lock, std::chrono::milliseconds(50), [&] { return shared.is_done; });
}

/// Tells `progress` what is new. Throws what it raises, Interrupted where it returns False.
void tell(Shared& shared, const py::object& progress) {
  std::string what;
  std::size_t done = 0, total = 0;
  {
    const std::scoped_lock lock(shared.mutex);
    if (!shared.has_news || progress.is_none()) return;
    shared.has_news = false;
    what = shared.what;
    done = shared.done;
    total = shared.total;
  }
  py::detail::make_caster<bool> goes_on;  // of bool and numpy's bool alone
  if (goes_on.load(called(progress, py::make_tuple(what, done, total)), false) && !goes_on) throw Interrupted();
}

}  // namespace

void wait_for(std::function<void(const Progress&)> work, const py::object& progress) {
  { const Released stays_after_the_end; }
  const std::shared_ptr<Shared> shared = begun_work();  // with the GIL: Python does not end in between
  std::thread thread([shared, work = std::move(work)]() mutable {
    std::exception_ptr thrown;
    try {
      work([&shared](std::string_view what, std::size_t done, std::size_t total) {
        return shared->report(what, done, total);
      });
    } catch (...) {
      thrown = std::current_exception();
    }
    work = {};  // what it holds goes before anybody hears of the end
    shared->end(thrown);
  });
  try {
    while (!wait_a_moment(*shared)) {
      if (PyErr_CheckSignals() != 0) throw py::error_already_set();
      tell(*shared, progress);
    }
    tell(*shared, progress);
  } catch (...) {
    leave_behind(shared, std::move(thread));
    throw;
  }
  thread.join();
  if (shared->thrown) std::rethrow_exception(shared->thrown);
}

std::shared_ptr<void> kept(py::object object) {
  return {object.release().ptr(), [](PyObject* held) {
            if (!Py_IsInitialized()) return;
            const py::gil_scoped_acquire acquired;
            Py_DECREF(held);
          }};
}

void bind_waiting(py::module_& module) {
  at_end(&stop_all, &join_all);
  static_cast<void>(module);
}

}  // namespace alidade::python
