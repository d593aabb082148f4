#pragma once

#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Thrown after the user pressed Ctrl-C. The command line turns it into one line and an exit code; nothing is written.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted; nothing written") {}
  /// For work that keeps what it has finished.
  explicit Interrupted(const std::string& what) : std::runtime_error(what) {}
};

/// Reports the progress of long-running work and can stop it: called now and then, from any thread, as (what, done,
/// total). If it returns false the work throws Interrupted. An empty Progress never stops the work and reports nothing.
using Progress = std::function<bool(std::string_view what, std::size_t done, std::size_t total)>;

inline void report_progress(const Progress& progress, std::string_view what, std::size_t done, std::size_t total) {
  if (progress && !progress(what, done, total)) throw Interrupted();
}

ALIDADE_PUBLIC_END
}  // namespace alidade
