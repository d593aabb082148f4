#include "alidade/track/checks/clock_shift.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "alidade/track/checks/rig_faults.h"

namespace alidade {
namespace {

constexpr std::size_t num_blocks = 8;

/// −ln p of the observations in each eighth of the log, for the acceleration of the target that maximises their joint
/// likelihood.
struct BlockCosts {
  std::array<double, num_blocks> block{};
  double nis_per_dof = 0.0;
  [[nodiscard]] double sum() const {
    double all = 0.0;
    for (const double each : block) all += each;
    return all;
  }
};

/// At most `most` rows: a longer log is represented by eight stretches, evenly spaced.
std::vector<std::vector<TargetObservation>> stretches_of(std::span<const TargetObservation> observations,
                                                         std::size_t most) {
  std::vector<std::vector<TargetObservation>> stretches;
  const std::size_t num = observations.size() > most ? num_blocks : 1,
                    length = std::min(observations.size(), most) / num;
  for (std::size_t k = 0; k < num; ++k) {
    const std::size_t first = num > 1 ? k * (observations.size() - length) / (num - 1) : 0;
    const auto part = observations.subspan(first, num > 1 ? length : observations.size());
    stretches.emplace_back(part.begin(), part.end());
  }
  return stretches;
}

void add_costs(const TrackReport& report, std::span<const TargetObservation> observations, double gate,
               std::size_t stretch, bool is_only, BlockCosts& costs, double& nis, double& num) {
  const double from_s = observations.front().t_capture_s, span_s = observations.back().t_capture_s - from_s;
  for (std::size_t i = 0; i < report.steps.size(); ++i) {
    const TrackStep& step = report.steps[i];
    const double share = span_s > 0.0 ? (observations[i].t_capture_s - from_s) / span_s : 0.0;
    const std::size_t block =
        is_only ? std::min(num_blocks - 1, static_cast<std::size_t>(share * num_blocks)) : stretch;
    double cost = 0.5 * gate;
    if (step.has_innovation)
      cost = 0.5 * (std::min(step.innovation.nis, gate) + std::log(step.innovation.S.determinant()));
    if (step.event == TrackEvent::restart) cost += gate;  // a restart hides its misfit
    costs.block[block] += cost;
    if (!step.has_innovation) continue;
    nis += std::min(step.innovation.nis, gate);
    num += 2.0;
  }
}

BlockCosts costs_of(const std::vector<std::vector<TargetObservation>>& stretches, std::span<const RigHead> heads,
                    const FollowConfig& config, const ClockShift& shift) {
  FollowConfig plain;
  plain.tracker = config.tracker;
  plain.find_sigma_a = plain.judge = false;
  plain.tracker.learn_errors = plain.tracker.errors.num() > 0 && plain.tracker.method != TargetMotion::imm;
  BlockCosts best;
  double least = std::numeric_limits<double>::infinity();
  // With the correct clock a target manoeuvres less, never more.
  const int max_halvings = config.find_sigma_a ? 5 : 1;
  for (int k = 0; k < max_halvings; ++k) {
    plain.tracker.sigma_a_m_s2 = config.tracker.sigma_a_m_s2 * std::pow(0.5, k);
    BlockCosts costs;
    double nis = 0.0, num = 0.0;
    for (std::size_t s = 0; s < stretches.size(); ++s) {
      const std::vector<TargetObservation> shifted = with_shift(stretches[s], shift);
      add_costs(track_target(shifted, heads, plain), shifted, plain.tracker.gate, s, stretches.size() == 1, costs, nis,
                num);
    }
    if (!(costs.sum() < least)) break;  // the likelihood of σ_a has a single maximum
    least = costs.sum();
    best = costs;
    best.nis_per_dof = num > 0.0 ? nis / num : std::numeric_limits<double>::infinity();
  }
  return best;
}

/// Whether the gain is not due to one part of the log only.
bool is_throughout(const BlockCosts& given, const BlockCosts& shifted) {
  constexpr double min_elsewhere = 10.0;  // in ln p, without the eighth that gains most
  double sum = 0.0, most = 0.0;
  for (std::size_t k = 0; k < num_blocks; ++k) {
    const double gain = given.block[k] - shifted.block[k];
    sum += gain;
    most = std::max(most, gain);
  }
  return sum - most > min_elsewhere;
}

/// Of the rivals, notes the one with the highest likelihood, if that is about as high as with the shift.
void note_rival(const std::vector<std::vector<TargetObservation>>& stretches, std::span<const RigHead> heads,
                const FollowConfig& config, std::span<const RigFault> rivals, double cost_as_given, ClockShift& shift) {
  constexpr double clear = 3.0;
  double most = shift.gain - clear;
  for (const RigFault& rival : rivals) {
    const double gain = cost_as_given - costs_of(stretches, without_fault({}, heads, rival).heads, config, {}).sum();
    if (!(gain > most)) continue;
    most = gain;
    shift.rival = rival.name;
    shift.rival_off = rival.off;
    shift.rival_gain = gain;
  }
}

}  // namespace

std::vector<TargetObservation> with_shift(std::span<const TargetObservation> observations, const ClockShift& shift) {
  std::vector<TargetObservation> shifted(observations.begin(), observations.end());
  for (TargetObservation& observation : shifted) {
    if (observation.head == shift.head) observation.t_capture_s += shift.later_s;
    observation.t_arrival_s = observation.t_capture_s;  // the likelihood must not depend on the order of arrival
  }
  std::ranges::stable_sort(shifted, {}, &TargetObservation::t_capture_s);
  return shifted;
}

std::optional<ClockShift> probable_clock_shift(std::span<const TargetObservation> observations,
                                               std::span<const RigHead> heads, const FollowConfig& config,
                                               std::span<const RigFault> rivals) {
  const std::size_t max_observations =
      config.tracker.errors.num() > 0 ? 1200 : 4000;  // learning is several times slower
  constexpr double min_gain = 20.0, nis_that_fits = 1.5;
  if (observations.size() < 2 * num_blocks) return std::nullopt;
  const auto stretches = stretches_of(with_shift(observations, {}), max_observations);
  const BlockCosts as_given = costs_of(stretches, heads, config, {});
  double most = min_gain;
  std::optional<ClockShift> best;
  BlockCosts of_best;
  const auto try_shift = [&](ClockShift shift) {
    const BlockCosts costs = costs_of(stretches, heads, config, shift);
    shift.gain = as_given.sum() - costs.sum();
    if (!(shift.gain > most)) return;
    most = shift.gain;
    best = shift;
    of_best = costs;
  };
  for (std::size_t head = heads.size() > 2 ? 0 : 1; head < heads.size(); ++head)
    for (const double ms : {5.0, 10.0, 20.0, 30.0, 45.0, 70.0, 100.0})
      for (const double sign : {1.0, -1.0}) try_shift({head, 1e-3 * sign * ms});
  if (!best) return best;
  const ClockShift coarse = *best;
  for (const double near_ms : {-12.0, -8.0, -4.0, 4.0, 8.0, 12.0})
    try_shift({coarse.head, coarse.later_s + 1e-3 * near_ms});
  if (!(of_best.nis_per_dof < nis_that_fits) || !is_throughout(as_given, of_best)) return std::nullopt;
  note_rival(stretches, heads, config, rivals, as_given.sum(), *best);
  return best;
}

}  // namespace alidade
