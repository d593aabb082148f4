#include "alidade/track/checks/time_steps.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"
#include "alidade/track/checks/clock_shift.h"
#include "alidade/track/checks/rig_faults.h"

namespace alidade {
namespace {

constexpr double tolerance_s = 2e-6;  // times since 1970 have a resolution of 0.24 µs as double

/// In order, each once.
std::vector<double> times_of(std::span<const TargetObservation> observations) {
  std::vector<double> times;
  for (const TargetObservation& observation : observations)
    if (std::isfinite(observation.t_capture_s)) times.push_back(observation.t_capture_s);
  std::ranges::sort(times);
  const auto same = [](double a, double b) { return b - a < tolerance_s; };
  times.erase(std::unique(times.begin(), times.end(), same), times.end());
  return times;
}

/// The step by all times, if they are whole steps of about that size apart; else 0.
double exact_step(std::span<const double> times, double about_s) {
  const double span_s = times.back() - times.front(), step_s = span_s / std::round(span_s / about_s);
  const bool are_whole = std::ranges::all_of(times, [&](double t_s) {
    const double steps = (t_s - times.front()) / step_s;
    return std::abs(steps - std::round(steps)) * step_s < tolerance_s;
  });
  return are_whole ? step_s : 0.0;
}

std::string in_ms(double seconds) { return text_of(1e3 * seconds, 3) + " ms"; }

}  // namespace

double step_of_times(std::span<const TargetObservation> observations) {
  constexpr std::size_t min_times = 16;
  constexpr double least_s = 1e-4;
  constexpr int max_parts = 10;
  const std::vector<double> times = times_of(observations);
  if (times.size() < min_times) return 0.0;
  double closest_s = times.back() - times.front();
  for (std::size_t k = 1; k < times.size(); ++k) closest_s = std::min(closest_s, times[k] - times[k - 1]);
  for (int parts = 1; parts <= max_parts && closest_s / parts > least_s - tolerance_s; ++parts)
    if (const double step_s = exact_step(times, closest_s / parts); step_s > 0.0) return step_s;
  return 0.0;
}

std::optional<StepMove> move_within_step(std::span<const TargetObservation> observations, const TrackReport& report) {
  constexpr double least_sigma = 0.5;
  StepMove move{.step_s = step_of_times(observations)};
  if (!(move.step_s > 0.0)) return std::nullopt;
  std::vector<double> moved, in_sigma;
  for (std::size_t i = report.steps.size() / 10; i < report.steps.size(); ++i) {
    const TrackStep& step = report.steps[i];
    if (!step.has_belief || !step.accepted) continue;
    const Eigen::Vector3d by = move.step_s * step.belief.x.segment<3>(3);
    moved.push_back(by.norm());
    in_sigma.push_back((by.array().abs() / step.belief.P.diagonal().head<3>().array().sqrt()).maxCoeff());
  }
  move.moved_m = median_of(moved);
  move.moved_in_sigma = median_of(in_sigma);
  if (!(move.moved_in_sigma > least_sigma)) return std::nullopt;
  return move;
}

std::string step_text(const StepMove& move) {
  return "all t_capture_s are whole steps of " + in_ms(move.step_s) +
         " apart: if images were taken between, and their times rounded down, all positions are up to so much late, "
         "which no observations show, and the target up to " +
         text_of(1e3 * move.moved_m, 2) + " mm off (" + text_of(move.moved_in_sigma, 2) + "σ)";
}

double step_that_explains(std::span<const TargetObservation> observations, const TrackReport& report,
                          const std::optional<ClockShift>& shift) {
  constexpr double slack_s = 0.003;  // clocks are known to about that
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
  // RMS of what rounding down takes: uniform from 0 to the step.
  return "write t_capture_s as exactly as it is known, or give --sigma-clock " + text_of(step_s / std::sqrt(3.0), 2);
}

}  // namespace alidade
