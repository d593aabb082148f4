#include "alidade/track/track.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/checks/frozen_rows.h"
#include "alidade/track/checks/rig_faults.h"
#include "alidade/track/checks/time_jitter.h"
#include "alidade/track/checks/time_steps.h"
#include "alidade/track/checks/track_assumed.h"
#include "alidade/track/white_noise.h"
#include "alidade/track/xiahou_tracker.h"

namespace alidade {
namespace {

constexpr double not_there = std::numeric_limits<double>::quiet_NaN();

/// Several steps may have the same time: the last one has the most information, and replaces them.
void add_smoothed(const std::optional<Tracker::Smoothed>& now, std::vector<PredictedStep>& smoothed) {
  if (!now) return;
  while (!smoothed.empty() && smoothed.back().t_s >= now->t_s) smoothed.pop_back();
  smoothed.push_back({now->t_s, true, now->belief});
}

/// The step of a row that is not followed: the predicted target at its time, from the other rows.
TrackStep kept_out_step(const Tracker& tracker, const TargetObservation& observation, const TrackReport& report) {
  TrackStep step;
  const auto expected = tracker.at(observation.t_capture_s);
  if (expected) {
    step.t_s = observation.t_capture_s;
    step.belief = *expected;
    step.has_belief = true;
  } else if (!report.steps.empty()) {
    step.t_s = report.steps.back().t_s;
    step.belief = report.steps.back().belief;
    step.has_belief = report.steps.back().has_belief;
  }
  step.event = TrackEvent::frozen;
  return step;
}

/// Optional outputs of following beyond the steps.
struct AlsoAsked {
  double predict_s = 0.0, smooth_s = 0.0;
  std::vector<bool> kept_out;  ///< As in FollowConfig.
  TrackWatch watch;
};

TrackReport followed(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                     const TrackerConfig& config, const Progress& progress, const AlsoAsked& also = {}) {
  TrackerConfig no_longer = config;  // no more history than there are observations
  no_longer.max_kept = std::min(config.max_kept, observations.size() + 1);
  Tracker tracker({heads.begin(), heads.end()}, no_longer);
  TrackReport report;
  report.sigma_a_m_s2 = config.sigma_a_m_s2;
  report.steps.reserve(observations.size());
  constexpr std::size_t between_reports = 64;
  for (const TargetObservation& observation : observations) {
    if (report.steps.size() % between_reports == 0)
      report_progress(progress, "tracking", report.steps.size(), observations.size());
    const bool is_kept_out = report.steps.size() < also.kept_out.size() && also.kept_out[report.steps.size()];
    const TrackStep step = is_kept_out ? kept_out_step(tracker, observation, report) : tracker.take(observation);
    report.num_used += step.accepted ? 1 : 0;
    report.num_starts += step.event == TrackEvent::start ? 1 : 0;
    report.num_restarts += step.event == TrackEvent::restart ? 1 : 0;
    if (step.has_innovation)
      report.log_likelihood -=
          0.5 * (std::min(step.innovation.nis, config.gate) + std::log(step.innovation.S.determinant()));
    report.steps.push_back(step);
    if (also.watch) also.watch(observation, step);
    if (also.smooth_s > 0.0) add_smoothed(tracker.smoothed(also.smooth_s), report.smoothed);
    if (!(also.predict_s > 0.0)) continue;
    const auto ahead = tracker.at(step.t_s + also.predict_s);
    report.ahead.push_back({step.t_s + also.predict_s, ahead.has_value(), ahead.value_or(Belief<6>{})});
  }
  if (report.num_starts > 0) report.status = TrackReport::Status::tracked;
  return report;
}

/// A σ, and ln p of the innovations with it.
struct Probable {
  double sigma = 0.0, log_likelihood = -std::numeric_limits<double>::infinity();
};

double ln_p(const TrackReport& report, double gate) {
  if (report.num_starts == 0) return -std::numeric_limits<double>::infinity();
  return report.log_likelihood - gate * static_cast<double>(report.num_restarts);  // a restart hides its misfit
}

/// The first few minutes: enough to decide.
std::span<const TargetObservation> first_of(std::span<const TargetObservation> observations) {
  constexpr std::size_t max_observations = 4000;
  return observations.first(std::min(observations.size(), max_observations));
}

/// The σ_a that maximises the likelihood of the innovations, from 0.03 to 30 m/s² in steps of a quarter of a decade.
Probable most_probable_sigma_a(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                               TrackerConfig config, const Progress& progress) {
  config.learn_errors = config.errors.num() > 0;  // otherwise the innovations are correlated
  Probable best{.sigma = config.sigma_a_m_s2};
  for (int quarter = -6; quarter <= 6; ++quarter) {
    config.sigma_a_m_s2 = std::pow(10.0, 0.25 * quarter);
    const double log_likelihood = ln_p(followed(first_of(observations), heads, config, progress), config.gate);
    if (log_likelihood > best.log_likelihood) best = {config.sigma_a_m_s2, log_likelihood};
  }
  return best;
}

double max_probable_sigma_a(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                            const TrackerConfig& config, const Progress& progress) {
  return most_probable_sigma_a(observations, heads, config, progress).sigma;
}

/// The observations that count in statistics: with a belief, and after the warm-up of the track.
std::vector<bool> counted(const std::vector<TrackStep>& steps, double warm_up_s) {
  std::vector<bool> result;
  double began_s = std::numeric_limits<double>::infinity();
  for (const TrackStep& step : steps) {
    if (step.event == TrackEvent::start) began_s = step.t_s;
    result.push_back(step.has_belief && step.t_s >= began_s + warm_up_s);
  }
  return result;
}

void add_errors(TrackReport& report, const std::vector<bool>& counts, const TrueTrack& truth,
                std::span<const double> bound) {
  double sum2 = 0.0, sum = 0.0, sum_nees = 0.0, sum_bound = 0.0, num = 0.0;
  report.nees.assign(report.steps.size(), not_there);
  for (std::size_t i = 0; i < report.steps.size(); ++i) {
    const TrackStep& step = report.steps[i];
    const auto position = truth.at(step.t_s);
    if (!step.has_belief || !position) continue;
    const Eigen::Vector3d error = step.belief.x.head<3>() - *position;
    report.nees[i] = position_nees(step, truth);
    // If several heads observe at one instant, the last observation completes the estimate.
    const bool is_complete = i + 1 == report.steps.size() || report.steps[i + 1].t_s != step.t_s;
    if (!counts[i] || !is_complete) continue;
    sum2 += error.squaredNorm();
    sum += error.norm();
    sum_nees += report.nees[i];
    if (!bound.empty()) sum_bound += bound[i] * bound[i];
    num += 1.0;
  }
  if (!(num > 0.0)) return;
  report.rms_m = std::sqrt(sum2 / num);
  report.mean_error_m = sum / num;
  report.nees_per_dof = sum_nees / (3.0 * num);
  if (!bound.empty()) report.pcrlb_m = std::sqrt(sum_bound / num);
}

/// Over the same time span as the errors of the steps.
void add_smoothed_error(TrackReport& report, const std::vector<bool>& counts, const TrueTrack& truth) {
  const auto first = std::ranges::find(counts, true);
  if (first == counts.end()) return;
  const double from_s = report.steps[static_cast<std::size_t>(first - counts.begin())].t_s;
  double sum2 = 0.0, num = 0.0;
  for (const PredictedStep& step : report.smoothed) {
    const auto position = truth.at(step.t_s);
    if (!position || step.t_s < from_s) continue;
    sum2 += (step.belief.x.head<3>() - *position).squaredNorm();
    num += 1.0;
  }
  if (num > 0.0) report.smoothed_rms_m = std::sqrt(sum2 / num);
}

}  // namespace

double position_nees(const TrackStep& step, const TrueTrack& truth) {
  const auto position = truth.at(step.t_s);
  if (!step.has_belief || !position) return not_there;
  const Eigen::Vector3d error = step.belief.x.head<3>() - *position;
  const Eigen::Matrix3d P = step.belief.P.topLeftCorner<3, 3>();
  return squared_mahalanobis(error, P);
}

namespace {

std::vector<TargetObservation> without_kept_out(std::span<const TargetObservation> observations,
                                                const std::vector<bool>& kept_out) {
  std::vector<TargetObservation> others;
  for (std::size_t i = 0; i < observations.size(); ++i)
    if (i >= kept_out.size() || !kept_out[i]) others.push_back(observations[i]);
  return others;
}

/// The observations in order of capture: the likelihood must not depend on the order of arrival.
std::vector<TargetObservation> as_captured(std::span<const TargetObservation> observations) {
  std::vector<TargetObservation> sorted(observations.begin(), observations.end());
  std::ranges::stable_sort(sorted, {}, [](const TargetObservation& s) { return std::pair(s.t_capture_s, s.head); });
  return sorted;
}

/// For the config's σ_px: its σ_a, estimated or given, and ln p with it.
Probable probable_sigma_a(std::span<const TargetObservation> sorted, std::span<const RigHead> heads,
                          const FollowConfig& config) {
  if (config.find_sigma_a) return most_probable_sigma_a(sorted, heads, config.tracker, config.progress);
  TrackerConfig learning = config.tracker;
  learning.learn_errors = learning.errors.num() > 0;
  return {learning.sigma_a_m_s2, ln_p(followed(first_of(sorted), heads, learning, config.progress), learning.gate)};
}

/// Of the σ_px that the white part of the noise allows, the one that maximises the likelihood of the
/// innovations. None if that part agrees with the config's σ_px, or is too large for a target detector.
std::optional<double> sigma_px_by_white(std::span<const TargetObservation> sorted, std::span<const RigHead> heads,
                                        const FollowConfig& config, double compared_px, double& log_likelihood) {
  constexpr double min_px = 0.2, max_px = 3.0;            // accuracy of target detectors
  constexpr double min_off = 3.0, min_off_smaller = 2.0;  // no fault of the rig makes noise look smaller
  constexpr int num_parts = 4;
  const auto first = first_of(sorted);
  const auto steps = followed(first, heads, config.tracker, config.progress).steps;
  const auto white = white_noise(first, heads, steps, compared_px, config.tracker.sigma_encoder_rad);
  if (!white || white->sigma_px > max_px) return std::nullopt;
  if (!(white->off_in_sigma > min_off || white->off_in_sigma < -min_off_smaller)) return std::nullopt;
  // Coloured noise does not show in the differences: where they are small, there may be more of it.
  const double low_px = white->off_in_sigma < 0.0 ? white->sigma_px : white->low_px;
  std::optional<double> best;
  FollowConfig as_that = config;
  for (int part = 0; part <= num_parts; ++part) {
    const double share = static_cast<double>(part) / num_parts;
    as_that.tracker.sigma_px = std::max(min_px, low_px + share * (white->high_px - low_px));
    const double ln_p_of_that = probable_sigma_a(sorted, heads, as_that).log_likelihood;
    if (best && !(ln_p_of_that > log_likelihood)) continue;
    log_likelihood = ln_p_of_that;
    best = as_that.tracker.sigma_px;
  }
  return best;
}

/// Estimates σ_px and σ_a if they are not given. The default σ_px stays unless the white part of the noise differs from
/// it and the innovations are then more likely: a wrong rig would require a larger one as well.
void find_sigmas(std::span<const TargetObservation> sorted, std::span<const RigHead> heads, FollowConfig& config) {
  constexpr double min_gain = 5.0;
  const Probable usual = probable_sigma_a(sorted, heads, config);
  const double usual_px = config.tracker.sigma_px;
  config.tracker.sigma_a_m_s2 = usual.sigma;
  if (!config.find_sigma_px) return;
  FollowConfig found = config;
  for (int again = 0; again < 2; ++again) {  // with the first σ, rejected observations may become accepted
    double log_likelihood = 0.0;
    const auto sigma_px = sigma_px_by_white(sorted, heads, found, usual_px, log_likelihood);
    if (!sigma_px || !(log_likelihood > usual.log_likelihood + min_gain)) return;
    found.tracker.sigma_px = *sigma_px;
    found.tracker.sigma_a_m_s2 = probable_sigma_a(sorted, heads, found).sigma;
  }
  config.tracker = found.tracker;
}

/// Mean NIS per degree of freedom over the counted steps.
double mean_nis(const std::vector<TrackStep>& steps, const std::vector<bool>& counts, double gate) {
  double sum = 0.0, num = 0.0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (!counts[i] || !steps[i].has_innovation) continue;
    sum += std::min(steps[i].innovation.nis, gate);
    num += 1.0;
  }
  return num > 0.0 ? sum / (2.0 * num) : not_there;
}

/// Factor by which the innovations require σ² to be inflated: if they are larger than stated, or autocorrelated.
double asked_inflation(const TrackReport& report) {
  constexpr double min_nis = 0.2, in_sigma = 3.5, max_correlation = 0.35;
  double correlated = 0.0, num = 0.0;
  for (const HeadInnovations& head : report.innovations) {
    correlated += static_cast<double>(head.num) * head.autocorrelation;
    num += static_cast<double>(head.num);
  }
  // With n observations, the mean NIS per degree of freedom has a σ of 1/√n.
  const double max_nis = 1.0 + std::max(min_nis, in_sigma / std::sqrt(std::max(1.0, num)));
  double inflation = report.nis_per_dof > max_nis ? report.nis_per_dof : 1.0;
  if (num > 0.0 && correlated / num > max_correlation) inflation *= (num + correlated) / (num - correlated);
  return inflation;
}

void inflate(TrackReport& report) {
  report.inflation = asked_inflation(report);
  if (!(report.inflation > 1.0)) return;
  for (TrackStep& step : report.steps) step.belief.P *= report.inflation;
  for (PredictedStep& step : report.ahead) step.belief.P *= report.inflation;
  for (PredictedStep& step : report.smoothed) step.belief.P *= report.inflation;
}

/// The path of the tests is from the model cv: with the σ_a of another model, which may be too small for it, the rig
/// would seem contradicted.
RigTests rig_tests(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                   const FollowConfig& config, const TrackReport& report) {
  RigTests tests = rig_faults(observations, heads, config.tracker);
  const bool is_suspected = !tests.faults.empty() && tests.faults.front().z > max_fault_z(report);
  if (!is_suspected || !config.find_sigma_a || config.tracker.method == TargetMotion::cv) return tests;
  TrackerConfig cv = config.tracker;
  cv.method = TargetMotion::cv;
  cv.sigma_a_m_s2 = max_probable_sigma_a(observations, heads, cv, config.progress);
  return cv.sigma_a_m_s2 > config.tracker.sigma_a_m_s2 ? rig_faults(observations, heads, cv) : tests;
}

/// Tests noise, motion and rig. If the errors of the rig are considered, uses the innovations of a filter that
/// estimates them.
void judge_observations(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                        const FollowConfig& config, TrackReport& report) {
  report.errors_are_counted = config.tracker.errors.num() > 0;
  TrackerConfig learning = config.tracker;
  learning.learn_errors = report.errors_are_counted;
  if (learning.learn_errors && learning.method == TargetMotion::imm) learning.method = TargetMotion::singer;
  const std::vector<TargetObservation> sorted = as_captured(observations);
  const std::vector<TrackStep> steps = followed(sorted, heads, learning, config.progress).steps;
  report.nis_per_dof = mean_nis(steps, counted(steps, config.warm_up_s), config.tracker.gate);
  report.innovations = test_innovations(sorted, heads, steps, config);
  report.jitter = time_jitter(sorted, heads, steps, config.tracker.gate);
  RigTests tests = rig_tests(sorted, heads, config, report);
  report.faults = std::move(tests.faults);
  report.power = std::move(tests.power);
}

}  // namespace

TrackerConfig with_history(const FollowConfig& config) {
  TrackerConfig tracker = config.tracker;
  if (config.smooth_s > 0.0) {
    tracker.history_s = std::max(tracker.history_s, 1.2 * config.smooth_s + 0.1);
    tracker.max_kept = std::max<std::size_t>(tracker.max_kept, 2048);
  }
  return tracker;
}

TrackReport track_target(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                         const FollowConfig& config, const TrueTrack& truth, const TrackWatch& watch) {
  FollowConfig used = config;
  std::vector<FrozenRows> frozen;
  if (config.judge && config.kept_out.empty()) {
    frozen = frozen_rows(observations, heads, config);
    used.kept_out = rows_of(frozen, observations);
  }
  const std::vector<TargetObservation> others = without_kept_out(observations, used.kept_out);
  const bool states_own = std::ranges::all_of(others, [](const TargetObservation& o) { return o.sigma_px > 0.0; });
  used.find_sigma_px = config.find_sigma_px && config.judge && !states_own && !coarse_readings(others, heads, config);
  if (used.find_sigma_a || used.find_sigma_px) find_sigmas(as_captured(others), heads, used);
  used.tracker = with_history(used);
  TrackReport report = followed(observations, heads, used.tracker, config.progress,
                                {config.predict_s, config.smooth_s, used.kept_out, watch});
  report.frozen = std::move(frozen);
  report.sigma_a_is_found = config.find_sigma_a;
  report.sigma_px = used.tracker.sigma_px;
  report.sigma_px_is_found = used.tracker.sigma_px != config.tracker.sigma_px;
  const std::vector<bool> counts = counted(report.steps, config.warm_up_s);
  if (config.judge) {
    judge_observations(others, heads, used, report);
    inflate(report);
    heed_faults(observations, heads, used, report);
    report.rounded = rounded_times(others, used, report);
    if (report.rounded) count_rounding(report.rounded->step_s, report);
    if (config.sigma_clock_s > 0.0) count_angle_delay(others, heads, config.sigma_clock_s, report);
  } else {
    report.nis_per_dof = mean_nis(report.steps, counts, config.tracker.gate);
  }
  if (!truth.t_s.empty()) {
    add_errors(report, counts, truth, track_bound(observations, heads, used, truth));
    add_smoothed_error(report, counts, truth);
  }
  return report;
}

TrackReport track_target_xiahou(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const XiahouConfig& config, const TrueTrack& truth, const TrackWatch& watch) {
  TrackReport report;
  XiahouTracker tracker(heads, config);
  for (const TargetObservation& observation : observations) {
    const TrackStep step = tracker.take(observation);
    report.num_starts += step.event == TrackEvent::start ? 1 : 0;
    report.num_used += step.accepted ? 2 : 0;
    report.steps.push_back(step);
    if (watch) watch(observation, step);
  }
  if (report.num_starts > 0) report.status = TrackReport::Status::tracked;
  if (!truth.t_s.empty()) add_errors(report, counted(report.steps, FollowConfig{}.warm_up_s), truth, {});
  return report;
}

}  // namespace alidade
