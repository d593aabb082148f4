#include "alidade/track.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>
#include <variant>

#include "alidade/pantilt/recent_rows.h"
#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/checks/lens_over_time.h"
#include "alidade/track/checks/track_assumed.h"
#include "alidade/track/track.h"
#include "alidade/track/xiahou_tracker.h"

namespace alidade {
namespace {

void require_sense(const Rig& rig) {
  if (const std::string of_rig = fault(rig); !of_rig.empty()) throw ConfigError(of_rig);
}

/// What is invalid in an observation; empty if nothing is.
std::string observation_fault(const TargetObservation& observation, std::size_t num_heads) {
  if (observation.head >= num_heads)
    return fmt::format("is of head {}, but the rig has {}, counted from 0", observation.head, num_heads);
  const bool is_finite = std::isfinite(observation.t_capture_s) && std::isfinite(observation.t_arrival_s) &&
                         observation.pan_tilt_rad.allFinite() && observation.px.allFinite();
  if (!is_finite) return "its times, angles and pixel must be finite";
  if (!(observation.t_arrival_s >= observation.t_capture_s)) return "arrives before its capture";
  if (!(observation.sigma_px >= 0.0 && std::isfinite(observation.sigma_px))) return "its σ must not be below zero";
  if (!observation.lens) return "";
  const bool is_lens = observation.lens->k.allFinite() && observation.lens->k.head<2>().minCoeff() > 0.0 &&
                       observation.lens->error_scale.allFinite();
  return is_lens ? "" : "its lens must be finite, with focal lengths above zero";
}

void require_sense(const TrueTrack& truth) {
  if (truth.t_s.size() != truth.position.size()) throw ConfigError("the truth has not one position per time");
  for (std::size_t i = 0; i < truth.t_s.size(); ++i) {
    if (!std::isfinite(truth.t_s[i]) || !truth.position[i].allFinite()) throw ConfigError("the truth must be finite");
    if (i > 0 && !(truth.t_s[i] > truth.t_s[i - 1])) throw ConfigError("the times of the truth must ascend");
  }
}

void require_paper(const TrackConfig& config, const Rig& rig) {
  if (config.method == TrackMethod::xiahou2015 && rig.heads.size() != 2)
    throw ConfigError("--method xiahou2015: needs a rig of two heads");
}

XiahouConfig xiahou_config(const TrackConfig& config, std::span<const RigHead> heads) {
  XiahouConfig paper;
  paper.baseline_cm =
      100.0 * (heads[1].head.world_from_base.translation - heads[0].head.world_from_base.translation).norm();
  paper.use_pixels = config.corrected;
  return paper;
}

TargetMotion motion_of(TrackMethod method) {
  switch (method) {
    case TrackMethod::singer:
      return TargetMotion::singer;
    case TrackMethod::turn:
      return TargetMotion::turn;
    case TrackMethod::imm:
      return TargetMotion::imm;
    case TrackMethod::ballistic:
      return TargetMotion::ballistic;
    default:
      return TargetMotion::cv;
  }
}

/// The largest delay between capture and arrival of a recording's observations after newer ones had arrived: up to 2 s
/// are waited for, so that the track does not depend on the order of arrival.
double lateness_s(const std::vector<TargetObservation>& observations) {
  constexpr double longest_s = 2.0, slack_s = 0.05;
  double newest_s = -std::numeric_limits<double>::infinity(), late_s = 0.0;
  for (const TargetObservation& observation : observations) {
    newest_s = std::max(newest_s, observation.t_capture_s);
    const double behind_s = newest_s - observation.t_capture_s;
    if (behind_s <= longest_s) late_s = std::max(late_s, behind_s + slack_s);
  }
  return late_s;
}

FollowConfig follow_config(const TrackConfig& config, const Rig& rig) {
  FollowConfig follow;
  TrackerConfig& tracker = follow.tracker;
  tracker.method = motion_of(config.method);
  follow.find_sigma_a = !config.sigma_a_m_s2;
  follow.find_sigma_px = !config.sigma_px;
  tracker.sigma_a_m_s2 = config.sigma_a_m_s2.value_or(tracker.sigma_a_m_s2);
  tracker.sigma_px = config.sigma_px.value_or(tracker.sigma_px);
  tracker.gravity_m_s2 = config.gravity_m_s2.value_or(tracker.gravity_m_s2);
  tracker.sigma_encoder_rad = config.sigma_angle_rad;
  tracker.min_depth_m = config.min_depth_m;
  tracker.max_depth_m = config.max_depth_m;
  tracker.errors = rig_uncertainty(rig, config.sigma_clock_s.value_or(0.0));
  follow.predict_s = config.predict_s.value_or(0.0);
  follow.smooth_s = config.smooth_s.value_or(0.0);
  follow.sigma_clock_s = config.sigma_clock_s.value_or(0.0);
  return follow;
}

/// Names the assumed intrinsics of a zoom lens after its history, as no single value applies.
void name_intrinsics_histories(const Rig& rig, std::vector<Assumption>& assumed) {
  for (std::size_t h = 0; h < rig.intrinsics_histories.size(); ++h) {
    if (rig.intrinsics_histories[h].lens.empty()) continue;
    const std::string of_camera = fmt::format("head{}.camera.", rig.heads[h].head.id);
    for (Assumption& one : assumed) {
      if (!one.name.starts_with(of_camera)) continue;
      const std::string what = one.name.substr(of_camera.size());
      if (what != "fx" && what != "fy" && what != "cx" && what != "cy") continue;
      one.name = fmt::format("head{}.intrinsics.{}", rig.heads[h].head.id, what);
      one.value = std::numeric_limits<double>::quiet_NaN();
    }
  }
}

/// The verdict for the filter of the paper, which has no tests.
Verdict paper_verdict(const TrackReport& report) {
  Verdict verdict;
  if (report.status == TrackReport::Status::no_start) {
    return {State::refused,
            ExitCode::undetermined,
            "the two heads' axes never meet in front of them",
            "check that events of both heads are there, or use --method cv",
            {}};
  }
  verdict.state = State::care;
  verdict.sentence = "the paper's filter: no gates, and its covariance does not say how good it is";
  return verdict;
}

void judge_track(const FollowConfig& follow, TargetTrack& result) {
  const TrackConfig& config = result.config;
  result.verdict = track_verdict(result, result.observations, result.rig.heads, follow);
  if (result.verdict.exit_code != ExitCode::ok) return;
  result.assumed = track_assumed(result.observations, result.rig, follow, result,
                                 {.sigma_px = config.sigma_px.has_value(),
                                  .sigma_a = config.sigma_a_m_s2.has_value(),
                                  .sigma_clock_s = config.sigma_clock_s.value_or(0.0)});
  name_intrinsics_histories(result.rig, result.assumed);
  heed_assumptions(result.assumed, result.verdict);
}

void heed_doubts(const Rig& rig, Verdict& verdict) {
  for (const std::string& doubt : rig.doubts) {
    const bool has_cause = verdict.state != State::good;
    heed({.name = "inputs", .state = State::care, .text = doubt}, rig_doubts_remedy, verdict);
    if (!has_cause) continue;
    verdict.sentence += "; " + doubt;  // which may explain it
    verdict.to_add = rig_doubts_remedy;
  }
}

}  // namespace

std::string intrinsics_history_fault(const std::vector<TargetObservation>& observations, const Rig& rig) {
  constexpr double beyond_s = 1.0;  // how long the last estimate of an observer is extrapolated [s]
  const auto outside = outside_history(observations, rig.intrinsics_histories, beyond_s);
  if (!outside) return "";
  const IntrinsicsHistory& history = rig.intrinsics_histories[outside->head];
  return fmt::format(
      "{}: gives head {}'s intrinsics from {:.6g} to {:.6g} s, but there is an observation at {:.6g} s; "
      "are the clocks the same?",
      history.name, rig.heads[outside->head].head.id, history.from_s, history.until_s, outside->t_s);
}

TargetTrack track(std::vector<TargetObservation> observations, Rig rig, const TrackConfig& config, TrueTrack truth,
                  const Progress& progress, const TrackWatch& watch) {
  require_sense(config);
  require_sense(rig);
  require_paper(config, rig);
  require_sense(truth);
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const std::string fault = observation_fault(observations[i], rig.heads.size());
    if (!fault.empty()) throw ConfigError(fmt::format("observation {}: {}", i, fault));
  }
  if (const std::string fault = intrinsics_history_fault(observations, rig); !fault.empty()) throw ConfigError(fault);
  TargetTrack result;
  result.counts.given = observations.size();
  if (!rig.intrinsics_histories.empty()) use_intrinsics_histories(rig.intrinsics_histories, observations, rig);
  result.observations = std::move(observations);
  result.rig = std::move(rig);
  result.truth = std::move(truth);
  result.config = config;
  const std::vector<RigHead>& heads = result.rig.heads;
  if (result.observations.empty()) {
    result.verdict = {
        State::refused, ExitCode::undetermined, "there are no observations", "give those of two heads", {}};
  } else if (config.method == TrackMethod::xiahou2015) {
    static_cast<TrackReport&>(result) =
        track_target_xiahou(result.observations, heads, xiahou_config(config, heads), result.truth, watch);
    result.verdict = paper_verdict(result);
  } else {
    FollowConfig follow = follow_config(config, result.rig);
    follow.progress = progress;
    follow.tracker.history_s = std::max(follow.tracker.history_s, lateness_s(result.observations));
    static_cast<TrackReport&>(result) = track_target(result.observations, heads, follow, result.truth, watch);
    follow.tracker.sigma_px = result.sigma_px;
    judge_track(follow, result);
  }
  if (result.verdict.exit_code == ExitCode::ok) heed_doubts(result.rig, result.verdict);
  result.counts.used = result.num_used;
  result.counts.dropped = result.counts.given - result.num_used;
  return result;
}

struct TargetTracker::State {
  Rig rig;
  TrackConfig config;
  std::variant<Tracker, XiahouTracker> tracker;
  RecentReadings readings;
  std::vector<TargetObservation> observations;

  /// Adds the uncertainty by the delay of the angles, as track() does.
  void count_delay(double t_s, Belief<6>& belief) const {
    if (config.sigma_clock_s && *config.sigma_clock_s > 0.0 && std::holds_alternative<Tracker>(tracker))
      readings.count_delay(rig.heads, *config.sigma_clock_s, t_s, belief);
  }
  std::size_t num_forgotten = 0;
};

namespace {

std::variant<Tracker, XiahouTracker> tracker_for(const Rig& rig, const TrackConfig& config) {
  require_sense(config);
  require_sense(rig);
  require_paper(config, rig);
  if (!rig.intrinsics_histories.empty())
    throw ConfigError("intrinsics over time are for recordings: give each observation its lens");
  if (config.method == TrackMethod::xiahou2015) return XiahouTracker(rig.heads, xiahou_config(config, rig.heads));
  return Tracker(rig.heads, with_history(follow_config(config, rig)));
}

}  // namespace

TargetTracker::TargetTracker(Rig rig, const TrackConfig& config)
    : state_(std::make_unique<State>(
          State{rig, config, tracker_for(rig, config), RecentReadings(rig.heads.size()), {}, 0})) {}
TargetTracker::~TargetTracker() = default;
TargetTracker::TargetTracker(TargetTracker&&) noexcept = default;
TargetTracker& TargetTracker::operator=(TargetTracker&&) noexcept = default;

TrackStep TargetTracker::push(const TargetObservation& observation) {
  const std::string fault = observation_fault(observation, state_->rig.heads.size());
  if (!fault.empty()) throw ConfigError("the observation " + fault);
  state_->observations.push_back(observation);
  state_->num_forgotten += forget_oldest(state_->observations, static_cast<std::size_t>(state_->config.keep_rows));
  TrackStep step = std::visit([&](auto& tracker) { return tracker.take(observation); }, state_->tracker);
  state_->readings.add(observation);
  if (step.has_belief) state_->count_delay(step.t_s, step.belief);
  return step;
}

std::optional<PredictedStep> TargetTracker::at(double t_s) const {
  const Tracker* tracker = std::get_if<Tracker>(&state_->tracker);
  auto belief = tracker != nullptr ? tracker->at(t_s) : std::nullopt;
  if (belief) state_->count_delay(t_s, *belief);
  return belief ? std::optional(PredictedStep{t_s, true, *belief}) : std::nullopt;
}

TargetTrack TargetTracker::finish(const TrueTrack& truth, const Progress& progress) const {
  TargetTrack result = track(state_->observations, state_->rig, state_->config, truth, progress);
  add_recent_rows(state_->num_forgotten, state_->observations.size(), "observations", result.verdict);
  return result;
}

}  // namespace alidade
