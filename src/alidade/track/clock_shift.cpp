#include "alidade/track/clock_shift.h"

#include <algorithm>
#include <limits>
#include <vector>

namespace alidade {
namespace {

double log_likelihood(std::span<const TargetSight> sights, std::span<const RigHead> heads, const TrackConfig& config,
                      const ClockShift& shift) {
  std::vector<TargetSight> shifted(sights.begin(), sights.end());
  for (TargetSight& sight : shifted) {
    if (sight.head != shift.head) continue;
    sight.t_capture_s += shift.later_s;
  }
  // In order of capture: what is probable does not depend on what arrived first.
  for (TargetSight& sight : shifted) sight.t_arrival_s = sight.t_capture_s;
  std::ranges::stable_sort(shifted, {}, &TargetSight::t_capture_s);
  TrackConfig plain;
  plain.tracker = config.tracker;
  plain.find_sigma_a = config.find_sigma_a;
  plain.judge = false;
  plain.tracker.learn_errors = plain.tracker.errors.num() > 0;
  const TrackReport report = track_target(shifted, heads, plain);
  return report.num_starts > 0 ? report.log_likelihood - config.tracker.gate * static_cast<double>(report.num_restarts)
                               : -std::numeric_limits<double>::infinity();
}

}  // namespace

std::optional<ClockShift> probable_clock_shift(std::span<const TargetSight> sights, std::span<const RigHead> heads,
                                               const TrackConfig& config) {
  const std::size_t most_sights = config.tracker.errors.num() > 0 ? 400 : 1000;  // learning costs several times more
  constexpr double least_gain = 30.0;                                            // of ln p: no noise brings that
  const auto first = sights.first(std::min(sights.size(), most_sights));
  const double as_told = log_likelihood(first, heads, config, {});
  double most = as_told + least_gain;
  std::optional<ClockShift> best;
  const auto try_shift = [&](const ClockShift& shift) {
    const double gained = log_likelihood(first, heads, config, shift);
    if (!(gained > most)) return;
    most = gained;
    best = shift;
  };
  for (std::size_t head = 1; head < heads.size(); ++head)
    for (const double ms : {10.0, 20.0, 30.0, 45.0, 70.0, 100.0})
      for (const double sign : {1.0, -1.0}) try_shift({head, 1e-3 * sign * ms});
  if (best)
    for (const double near_ms : {-8.0, -4.0, 4.0, 8.0}) try_shift({best->head, best->later_s + 1e-3 * near_ms});
  return best;
}

}  // namespace alidade
