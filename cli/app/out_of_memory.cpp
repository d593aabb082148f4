#include "cli/app/out_of_memory.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <csignal>
#include <cstdlib>
#include <exception>
#include <new>

#include "alidade/estimation/verdict.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

constexpr std::size_t reserve_bytes = 1 << 20;  // never touched, so that it costs an address and no memory
std::array<std::atomic<void*>, 4> reserve{};

/// Gives a part of the reserve back, after which the allocation is tried again; throws where none is left.
void release_reserve() {
  for (std::atomic<void*>& part : reserve) {
    if (void* const bytes = part.exchange(nullptr)) {
      std::free(bytes);
      return;
    }
  }
  throw std::bad_alloc();
}

/// glibc ends a process for which it cannot register the destructor of a thread's object, with a line of its own.
extern "C" void on_abort(int) {
  tell_without_memory(
      "alidade: error: internal: a library ended the process: not enough memory, or a bug; please report it\n");
  ::_exit(static_cast<int>(ExitCode::internal_error));
}

/// Without an allocation, unlike the standard one's names of exceptions.
[[noreturn]] void end_in_one_line() {
  const bool is_used_up = std::ranges::none_of(reserve, [](const auto& part) { return part.load() != nullptr; });
  try {
    if (std::current_exception()) std::rethrow_exception(std::current_exception());
    if (is_used_up) {
      tell_out_of_memory();  // not even for an exception there was room
    } else {
      tell_without_memory("alidade: error: internal: an end without an error; please report this\n");
    }
  } catch (const std::bad_alloc&) {
    tell_out_of_memory();
  } catch (...) {
    tell_without_memory("alidade: error: internal: an error within the handling of another; please report this\n");
  }
  ::_exit(static_cast<int>(ExitCode::internal_error));
}

}  // namespace

void tell_out_of_memory() {
  tell_without_memory("alidade: error: internal: not enough memory; use fewer or smaller inputs\n");
}

void prepare_for_out_of_memory() {
  for (std::atomic<void*>& part : reserve) {
    if (part.load() == nullptr) part = std::malloc(reserve_bytes);
  }
  std::set_new_handler(release_reserve);
  std::set_terminate(end_in_one_line);
  std::signal(SIGABRT, on_abort);
}

}  // namespace alidade::cli
