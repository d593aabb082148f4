#pragma once

#include <cstddef>
#include <string>
#include <vector>

#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// An input file of a result.
struct InputFile {
  std::string role;  ///< photo, camera, log, …
  std::string name;  ///< As given.
  std::size_t bytes = 0;
  std::string sha256;
};

/// A rejected row or photo, and the reason. Line 0: the whole file.
struct SkippedInput {
  std::string file;
  std::size_t line = 0;
  std::string reason;
};

/// How much was given, and what became of it: photos in calibrate, rows or frames elsewhere.
struct Counts {
  std::size_t given = 0;
  std::size_t used = 0;
  std::size_t dropped = 0;
  std::vector<SkippedInput> skipped;
};

/// Counts rows that were rejected in reading as given, and lists them before those that the job itself rejected.
inline void add_skipped(const std::vector<SkippedInput>& rows, Counts& counts) {
  counts.given += rows.size();
  counts.skipped.insert(counts.skipped.begin(), rows.begin(), rows.end());
}

ALIDADE_PUBLIC_END
}  // namespace alidade
