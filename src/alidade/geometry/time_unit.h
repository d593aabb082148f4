#pragma once

#include <optional>

namespace alidade {

/// A unit that times may be in which should be seconds.
struct TimeUnit {
  const char* name = "";
  double seconds = 1.0;
};

/// By how far apart the rows of a log are that was taken several times a second or oftener; none: they may be seconds.
[[nodiscard]] inline std::optional<TimeUnit> time_unit_by_spacing(double spacing_s) {
  constexpr double longest_s = 1.0;
  if (!(spacing_s > longest_s)) return std::nullopt;
  if (spacing_s < 1e3 * longest_s) return TimeUnit{"milliseconds", 1e-3};
  return spacing_s < 1e6 * longest_s ? TimeUnit{"microseconds", 1e-6} : TimeUnit{"nanoseconds", 1e-9};
}

}  // namespace alidade
