#pragma once

#include <filesystem>
#include <string>

#include "alidade/files/files.h"

namespace alidade::cli {

/// First and last time of a path [s].
struct TimeSpan {
  double from_s = 0.0, until_s = 0.0;
};

/// A truth was given in error where too little of the path can be compared with it: that is said, with both spans, in
/// place of a result without a word of it. `compared`: how much can be, and how much is needed.
[[nodiscard]] InputError truth_of_other_times(const std::filesystem::path& file, const TimeSpan& truth,
                                              const TimeSpan& path, const std::string& compared);

}  // namespace alidade::cli
