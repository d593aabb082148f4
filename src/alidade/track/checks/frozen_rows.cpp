#include "alidade/track/checks/frozen_rows.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

/// One head's pixels or readings in order of time.
struct Series {
  std::vector<double> t_s;
  std::vector<Eigen::Vector2d> values;

  [[nodiscard]] bool repeats(std::size_t k) const { return values[k] == values[k - 1]; }
  [[nodiscard]] double rate(std::size_t k) const {
    return (values[k] - values[k - 1]).norm() / std::max(t_s[k] - t_s[k - 1], 1e-6);
  }
};

/// The rows first … last − 1 that repeat the one before.
struct Run {
  std::size_t first = 0, last = 0;
  [[nodiscard]] std::size_t num() const { return last - first; }
};

Run longest_run(const Series& series) {
  Run longest;
  for (std::size_t k = 1; k < series.values.size(); ++k) {
    if (!series.repeats(k)) continue;
    Run run{k, k};
    while (run.last < series.values.size() && series.repeats(run.last)) ++run.last;
    if (run.num() > longest.num()) longest = run;
    k = run.last;
  }
  return longest;
}

/// Whether values are multiples of a step that is not far below what they change by: rounded ones repeat.
bool is_rounded(const Series& series) {
  constexpr double finer = 20.0;
  for (const int axis : {0, 1}) {
    std::vector<double> changes;
    for (std::size_t k = 1; k < series.values.size(); ++k)
      if (const double by = std::abs(series.values[k][axis] - series.values[k - 1][axis]); by > 0.0)
        changes.push_back(by);
    if (changes.empty() || finer * *std::ranges::min_element(changes) > median_of(changes)) return true;
  }
  return false;
}

/// Rows repeat by chance with the rate at which those outside the run do: of n rows one run of that length is expected
/// less than once in 10⁴ logs.
bool is_beyond_chance(const Series& series, const Run& run) {
  constexpr std::size_t least = 3;
  constexpr double rare = 1e-4;
  if (run.num() < least) return false;
  double others = 0.0, repeated = 0.0;
  for (std::size_t k = 1; k < series.values.size(); ++k) {
    if (k >= run.first && k < run.last) continue;
    others += 1.0;
    repeated += series.repeats(k) ? 1.0 : 0.0;
  }
  const double share = (repeated + 1.0) / (others + 2.0);
  return static_cast<double>(series.values.size()) * std::pow(share, static_cast<double>(run.num())) < rare;
}

/// Whether values have noise from row to row: of white noise third differences are √(20/6) = 1.8 times as large as
/// second ones; of a motion that the rows resolve they are smaller.
bool is_noisy(const Series& series) {
  constexpr double between = 1.3;
  std::vector<double> second, third;
  const auto& at = series.values;
  for (std::size_t k = 3; k < at.size(); ++k) {
    const Eigen::Vector2d before = at[k - 1] - 2.0 * at[k - 2] + at[k - 3], now = at[k] - 2.0 * at[k - 1] + at[k - 2];
    second.push_back(now.norm());
    third.push_back((now - before).norm());
  }
  return median_of(third) > between * median_of(second);
}

/// What goes on behind the run is further away than any other row goes.
bool jumps_behind(const Series& series, const Run& run) {
  constexpr double clearly = 1.5;
  if (run.last >= series.values.size()) return false;
  double fastest = 0.0;
  for (std::size_t k = 1; k < series.values.size(); ++k)
    if (k < run.first || k > run.last) fastest = std::max(fastest, series.rate(k));
  return series.rate(run.last) > clearly * fastest;
}

}  // namespace

std::optional<FrozenRows> frozen_rows(std::span<const TargetObservation> observations, std::size_t num_heads) {
  constexpr std::size_t min_rows = 60;
  std::optional<FrozenRows> worst;
  for (std::size_t h = 0; h < num_heads; ++h) {
    for (const bool is_of_pixels : {true, false}) {
      Series series;
      for (const TargetObservation& observation : observations) {
        if (observation.head != h) continue;
        series.t_s.push_back(observation.t_capture_s);
        series.values.push_back(is_of_pixels ? observation.px : observation.pan_tilt_rad);
      }
      if (series.values.size() < min_rows) continue;
      const Run run = longest_run(series);
      if (!is_beyond_chance(series, run) || is_rounded(series)) continue;
      if (!is_of_pixels && !is_noisy(series) && !jumps_behind(series, run)) continue;
      if (!worst || run.num() > worst->num)
        worst = FrozenRows{h, is_of_pixels, run.num(), series.t_s[run.first], series.t_s[run.last - 1]};
    }
  }
  return worst;
}

std::string frozen_text(const FrozenRows& frozen, std::span<const RigHead> heads) {
  return std::string(frozen.is_of_pixels ? "the pixels" : "the angles") + " of head " +
         std::to_string(heads[frozen.head].head.id) + " are exactly those of the row before in " +
         std::to_string(frozen.num) + " rows from " + text_of(frozen.from_s, 5) + " to " + text_of(frozen.until_s, 5) +
         " s: " + (frozen.is_of_pixels ? "its image, or the detector," : "its encoders, or their log,") +
         " stood still";
}

std::string frozen_remedy(const FrozenRows& frozen, std::span<const RigHead> heads) {
  return "leave out the rows of head " + std::to_string(heads[frozen.head].head.id) + " from " +
         text_of(frozen.from_s, 5) + " to " + text_of(frozen.until_s, 5) + " s";
}

}  // namespace alidade
