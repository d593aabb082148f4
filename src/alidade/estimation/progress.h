#pragma once

#include <cstddef>
#include <functional>
#include <stdexcept>
#include <string>
#include <string_view>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The user pressed Ctrl-C; the command line turns it into one line and its exit code, nothing is written.
struct Interrupted : std::runtime_error {
  Interrupted() : std::runtime_error("interrupted; nothing written") {}
  /// For work that keeps what it has done.
  explicit Interrupted(const std::string& what) : std::runtime_error(what) {}
};

/// How long-running work reports progress and is stopped: called now and then, from any thread, as (what, done, total).
/// Returns false to stop; the work then throws Interrupted. An empty Progress never stops and shows nothing.
using Progress = std::function<bool(std::string_view what, std::size_t done, std::size_t total)>;

inline void report_progress(const Progress& progress, std::string_view what, std::size_t done, std::size_t total) {
  if (progress && !progress(what, done, total)) throw Interrupted();
}

ALIDADE_PUBLIC_END
}  // namespace alidade
