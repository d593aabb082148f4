#include "alidade/track/checks/time_steps.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <limits>
#include <map>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"
#include "alidade/geometry/time_unit.h"
#include "alidade/track/checks/clock_shift.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/checks/rig_faults.h"

namespace alidade {
namespace {

constexpr double tolerance_s = 2e-6;  // as double, times since 1970 have a resolution of 0.24 µs

/// Distinct times in ascending order.
std::vector<double> times_of(std::span<const TargetObservation> observations) {
  std::vector<double> times;
  for (const TargetObservation& observation : observations)
    if (std::isfinite(observation.t_capture_s)) times.push_back(observation.t_capture_s);
  std::ranges::sort(times);
  const auto same = [](double a, double b) { return b - a < tolerance_s; };
  times.erase(std::unique(times.begin(), times.end(), same), times.end());
  return times;
}

/// The step estimated from all times, if they are whole multiples of it apart and it is about `about_s`; else 0.
double exact_step(std::span<const double> times, double about_s) {
  const double span_s = times.back() - times.front(), step_s = span_s / std::round(span_s / about_s);
  const bool are_whole = std::ranges::all_of(times, [&](double t_s) {
    const double steps = (t_s - times.front()) / step_s;
    return std::abs(steps - std::round(steps)) * step_s < tolerance_s;
  });
  return are_whole ? step_s : 0.0;
}

std::string in_ms(double seconds) { return text_of(1e3 * seconds, 3) + " ms"; }

long most_frequent(std::span<const long> intervals) {
  std::map<long, std::size_t> num;
  for (const long interval : intervals) ++num[interval];
  return std::ranges::max_element(num, {}, [](const auto& one) { return one.second; })->first;
}

/// Whether intervals near the usual one, but neither it nor its multiples (gaps), recur. If images are missing from a
/// camera with one per step, the usual interval is one step; if most are missing, intervals have any length.
bool are_irregular(std::span<const long> intervals, long usual) {
  const auto num = std::ssize(intervals);
  const long middle = median_of(std::vector<long>(intervals.begin(), intervals.end()));
  const auto about = std::ranges::count_if(intervals, [&](long n) { return 2 * std::abs(n - middle) <= middle; });
  const auto single = std::ranges::count(intervals, 1L), most = std::ranges::count(intervals, usual);
  if (2 * single > most || 4 * about < 3 * num) return false;
  std::ptrdiff_t odd = 0;
  for (std::size_t k = 1; k < intervals.size(); ++k)
    odd += intervals[k] % usual != 0 && intervals[k] != intervals[k - 1] ? 1 : 0;
  return odd >= 8 && 10 * odd >= num;
}

/// The longest sequence of intervals of `shorter` or `shorter` + 1 steps.
std::span<const long> longest_stretch(std::span<const long> intervals, long shorter) {
  std::span<const long> longest;
  for (std::size_t begin = 0, end = 0; begin < intervals.size(); begin = end + 1) {
    for (end = begin; end < intervals.size() && (intervals[end] == shorter || intervals[end] == shorter + 1);) ++end;
    if (end - begin > longest.size()) longest = intervals.subspan(begin, end - begin);
  }
  return longest;
}

/// Whether images at a constant rate between the steps have such intervals: their cumulative sums are within one step,
/// plus a little jitter of the camera, of a straight line.
bool are_of_one_rate(std::span<const long> intervals) {
  constexpr double within = 1.2;
  double low = 0.0, high = std::numeric_limits<double>::infinity();
  for (std::size_t i = 0; i < intervals.size(); ++i) {
    double moved = 0.0, num = 0.0;
    for (std::size_t j = i; j < intervals.size(); ++j) {
      moved += static_cast<double>(intervals[j]);
      num += 1.0;
      low = std::max(low, (moved - within) / num);
      high = std::min(high, (moved + within) / num);
    }
  }
  return low < high;
}

}  // namespace

bool are_between_steps(std::span<const double> times_s, double step_s) {
  constexpr std::ptrdiff_t min_intervals = 16, min_stretch = 24, max_stretch = 300;
  std::vector<long> intervals;
  for (std::size_t k = 1; k < times_s.size(); ++k)
    intervals.push_back(std::lround((times_s[k] - times_s[k - 1]) / step_s));
  if (std::ssize(intervals) < min_intervals) return false;
  const long usual = most_frequent(intervals);
  if (usual > 1 && are_irregular(intervals, usual)) return true;
  for (const long shorter : {usual - 1, usual}) {
    if (shorter < 1) continue;
    std::span<const long> stretch = longest_stretch(intervals, shorter);
    stretch = stretch.first(static_cast<std::size_t>(std::min(std::ssize(stretch), max_stretch)));
    // Intervals of one and two steps may be gaps: more are needed to show that they are evenly spaced.
    const std::ptrdiff_t least = shorter > 1 ? 4 : 8, num = std::ranges::count(stretch, shorter);
    const bool has_both = std::min(num, std::ssize(stretch) - num) >= least;
    if (std::ssize(stretch) >= min_stretch && has_both && are_of_one_rate(stretch)) return true;
  }
  return false;
}

double step_of_times(std::span<const TargetObservation> observations) {
  constexpr std::size_t min_times = 16;
  constexpr double least_s = 1e-4;
  constexpr int max_parts = 50;
  const std::vector<double> times = times_of(observations);
  if (times.size() < min_times) return 0.0;
  double closest_s = times.back() - times.front();
  for (std::size_t k = 1; k < times.size(); ++k) closest_s = std::min(closest_s, times[k] - times[k - 1]);
  for (int parts = 1; parts <= max_parts && closest_s / parts > least_s - tolerance_s; ++parts)
    if (const double step_s = exact_step(times, closest_s / parts); step_s > 0.0) return step_s;
  return 0.0;
}

StepMove move_by_time(double late_s, const TrackReport& report) {
  StepMove move{.step_s = late_s};
  std::vector<double> moved, in_sigma;
  for (std::size_t i = report.steps.size() / 10; i < report.steps.size(); ++i) {
    const TrackStep& step = report.steps[i];
    if (!step.has_belief || !step.accepted) continue;
    const Eigen::Vector3d by = late_s * step.belief.x.segment<3>(3);
    moved.push_back(by.norm());
    in_sigma.push_back((by.array().abs() / step.belief.P.diagonal().head<3>().array().sqrt()).maxCoeff());
  }
  move.moved_m = median_of(moved);
  move.moved_in_sigma = median_of(in_sigma);
  return move;
}

std::optional<StepMove> move_within_step(std::span<const TargetObservation> observations, const TrackReport& report) {
  constexpr double least_sigma = 0.5;
  const double step_s = step_of_times(observations);
  if (!(step_s > 0.0)) return std::nullopt;
  const StepMove move = move_by_time(step_s, report);
  return move.moved_in_sigma > least_sigma ? std::optional(move) : std::nullopt;
}

std::optional<RoundedTimes> rounded_times(std::span<const TargetObservation> observations, const FollowConfig& config,
                                          const TrackReport& report) {
  std::map<std::size_t, std::vector<TargetObservation>> of_head;
  for (const TargetObservation& observation : observations) of_head[observation.head].push_back(observation);
  double step_s = 0.0, counted_s = 0.0;
  for (const auto& [head, some] : of_head) {
    const double own_s = step_of_times(some);
    if (own_s > step_s && are_between_steps(times_of(some), own_s)) step_s = own_s;
  }
  for (const Eigen::MatrixXd& factor : config.tracker.errors.factor)
    if (factor.rows() > 0) counted_s = std::max(counted_s, factor.row(factor.rows() - 1).norm());
  if (!(step_s > std::sqrt(12.0) * counted_s)) return std::nullopt;
  const StepMove move = move_by_time(0.5 * step_s, report);
  return RoundedTimes{.step_s = step_s, .late_m = move.moved_m, .late_in_sigma = move.moved_in_sigma};
}

Check rounded_check(const RoundedTimes& rounded) {
  constexpr double max_sigma = 1.0;
  return {.name = "times",
          .state = rounded.late_in_sigma > max_sigma ? State::care : State::good,
          .text = "all times are whole steps of " + in_ms(rounded.step_s) +
                  " apart, and images were taken between: if their times were rounded down, they are " +
                  in_ms(0.5 * rounded.step_s) + " early, and the target " + text_of(1e3 * rounded.late_m, 2) +
                  " mm off (" + text_of(rounded.late_in_sigma, 2) + "σ); σ includes that",
          .value = rounded.late_in_sigma,
          .limit = max_sigma,
          .unit = "σ",
          .figure = "track"};
}

void count_rounding(double step_s, TrackReport& report) {
  const auto widen = [step_s](Belief<6>& belief) {
    const Eigen::Vector3d moved = 0.5 * step_s * belief.x.segment<3>(3);
    belief.P.topLeftCorner<3, 3>() += moved * moved.transpose();
  };
  for (TrackStep& step : report.steps) widen(step.belief);
  for (PredictedStep& step : report.ahead) widen(step.belief);
  for (PredictedStep& step : report.smoothed) widen(step.belief);
}

std::string step_text(const StepMove& move) {
  return "all t_capture_s are whole steps of " + in_ms(move.step_s) +
         " apart: if images were taken between, and their times rounded down, all positions are up to so much late, "
         "which no observations show, and the target up to " +
         text_of(1e3 * move.moved_m, 2) + " mm off (" + text_of(move.moved_in_sigma, 2) + "σ)";
}

double step_that_explains(std::span<const TargetObservation> observations, const TrackReport& report,
                          const std::optional<ClockShift>& shift) {
  constexpr double slack_s = 0.003;  // clocks are known to about that [s]
  double off_s = 0.0;
  if (shift && !shift->is_worse_than_rival()) off_s = std::abs(shift->later_s);
  if (!(off_s > 0.0) && !alike_per_head(report).empty())
    for (const RigFault& fault : report.faults)
      if (fault.name.ends_with("clock_s") && is_alike(report.faults.front(), fault))
        off_s = std::max(off_s, std::abs(fault.off));
  const double step_s = off_s > 0.0 ? step_of_times(observations) : 0.0;
  return off_s < step_s + slack_s ? step_s : 0.0;
}

std::string rounding_text(double step_s) {
  return "all times are whole steps of " + in_ms(step_s) +
         " apart: if they were rounded to that, the clocks of heads differ by up to so much by that alone, and all "
         "positions may be as late";
}

std::string rounding_remedy(double step_s) {
  // RMS of the error of rounding down: uniform from 0 to the step.
  return "write t_capture_s as exactly as it is known, or give --sigma-clock " + text_of(step_s / std::sqrt(3.0), 2);
}

namespace {

/// Mean interval between the rows of the head with the shortest one [s].
double usual_spacing_s(std::span<const TargetObservation> observations, std::size_t num_heads) {
  double least_s = std::numeric_limits<double>::infinity();
  for (std::size_t head = 0; head < num_heads; ++head) {
    std::vector<TargetObservation> own(observations.begin(), observations.end());
    std::erase_if(own, [head](const TargetObservation& observation) { return observation.head != head; });
    const std::vector<double> times = times_of(own);
    std::vector<double> apart_s;
    for (std::size_t k = 1; k < times.size(); ++k) apart_s.push_back(times[k] - times[k - 1]);
    if (!apart_s.empty()) least_s = std::min(least_s, median_of(apart_s));
  }
  return std::isfinite(least_s) ? least_s : 0.0;
}

/// Whether the observations fit with the times from `scaled`, and with a far higher likelihood.
template <class Scaled>
bool are_likelier(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                  const FollowConfig& config, const Scaled& scaled) {
  constexpr std::size_t max_observations = 1200;
  constexpr double min_gain = 30.0;
  std::vector<TargetObservation> given(observations.begin(), observations.end());
  for (TargetObservation& observation : given) scaled(observation);
  given = with_shift(given, {});
  given.resize(std::min(given.size(), max_observations));
  const Trial as_that = tried(given, heads, config);
  return as_that.fits &&
         as_that.ln_p > tried(with_shift(observations.first(given.size()), {}), heads, config).ln_p + min_gain;
}

}  // namespace

std::optional<Check> unit_of_times(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                   const FollowConfig& config) {
  const double spacing_s = usual_spacing_s(observations, heads.size());
  const auto unit = time_unit_by_spacing(spacing_s);
  if (!unit ||
      !are_likelier(observations, heads, config, [&](TargetObservation& o) { o.t_capture_s *= unit->seconds; }))
    return std::nullopt;
  return Check{"times",
               State::care,
               "rows are " + text_of(spacing_s) + " s apart: are these " + unit->name + "? t_capture_s is in seconds",
               spacing_s,
               1.0,
               "s",
               "track"};
}

std::optional<Check> units_of_heads_times(std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, const FollowConfig& config) {
  if (time_unit_by_spacing(usual_spacing_s(observations, heads.size()))) return std::nullopt;
  for (std::size_t head = 0; head < heads.size(); ++head) {
    std::vector<TargetObservation> own(observations.begin(), observations.end());
    std::erase_if(own, [head](const TargetObservation& observation) { return observation.head != head; });
    const double spacing_s = usual_spacing_s(own, heads.size());
    const auto unit = time_unit_by_spacing(spacing_s);
    if (!unit || !are_likelier(observations, heads, config, [&](TargetObservation& o) {
          if (o.head == head) o.t_capture_s *= unit->seconds;
        }))
      continue;
    return Check{"times",
                 State::bad,
                 "rows of head " + std::to_string(heads[head].head.id) + " are " + text_of(spacing_s) +
                     " s apart, those of the others " + text_of(usual_spacing_s(observations, heads.size())) +
                     ": are its times " + unit->name + "? t_capture_s is in seconds",
                 spacing_s,
                 1.0,
                 "s",
                 "track"};
  }
  return std::nullopt;
}

}  // namespace alidade
