#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <string>
#include <string_view>

#include "alidade/track/checks/clock_shift.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/checks/frozen_rows.h"
#include "alidade/track/checks/lean.h"
#include "alidade/track/checks/other_object.h"
#include "alidade/track/checks/rig_faults.h"
#include "alidade/track/checks/time_jitter.h"
#include "alidade/track/checks/time_steps.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

constexpr double good_nees = 2.0, max_nees = 9.0;  // per degree of freedom, if the truth is given
constexpr double good_nees_of_one = 3.8;           // for errors that are constant along a track: 99 %, three components
constexpr double care_rejected = 0.05, max_rejected = 0.2;
constexpr double min_used_share = 0.7;

double used_share(const TrackReport& report) {
  return report.steps.empty() ? 0.0 : static_cast<double>(report.num_used) / static_cast<double>(report.steps.size());
}

std::size_t count(const TrackReport& report, TrackEvent event) {
  return static_cast<std::size_t>(std::ranges::count(report.steps, event, &TrackStep::event));
}

bool fits(const TrackReport& report) {
  return report.num_starts > 0 && used_share(report) > min_used_share && !(report.nis_per_dof > max_nis) &&
         report.num_restarts * 20 <= report.steps.size();
}

using Observations = std::vector<TargetObservation>;
using Fault = Explanation;

/// Pixels outside the image of the rig's camera: the rig file is for another camera.
std::optional<Fault> other_camera(const TrackReport& report, std::span<const TargetObservation> observations,
                                  std::span<const RigHead> heads) {
  constexpr double max_share = 0.05;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    double num = 0.0, outside = 0.0;
    for (std::size_t i = 0; i < observations.size() && i < report.steps.size(); ++i) {
      if (observations[i].head != h) continue;
      num += 1.0;
      outside += report.steps[i].event == TrackEvent::outside ? 1.0 : 0.0;
    }
    if (!(outside > max_share * num)) continue;
    return Fault{text_of(100.0 * outside / num) + " % of the observations of head " + std::to_string(heads[h].head.id) +
                     " lie outside its image of " + std::to_string(heads[h].camera.width_px) + " x " +
                     std::to_string(heads[h].camera.height_px) + " px",
                 "give the rig file of the camera that took them"};
  }
  return std::nullopt;
}

Verdict refused(Fault fault) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::undetermined;
  verdict.sentence = std::move(fault.what);
  verdict.to_add = std::move(fault.to_do);
  return verdict;
}

Check check(std::string name, State state, std::string text, double value, double limit, std::string unit) {
  return {std::move(name), state, std::move(text), value, limit, std::move(unit), "track"};
}

/// Checks whether innovations are white, and which parameters of the rig the observations contradict.
void add_white(const TrackReport& report, std::span<const RigHead> heads, Verdict& verdict) {
  const Lean lean = worst_lean(report, heads);
  const Check lean_check =
      check("lean", lean.size > 0.0 ? State::care : State::good,
            lean.size > 0.0 ? lean.text : "by head, motion and position the innovations have no lean", lean.size,
            min_mean_lean, "σ");
  if (!report.faults.empty()) {
    const double z = report.faults.front().z, max_z = max_fault_z(report);
    verdict.checks.push_back(check("rig", z > max_z ? State::care : State::good,
                                   z > max_z ? fault_text(report) : "the heads' rays meet as the rig file lets them", z,
                                   max_z, "σ"));
  }
  verdict.checks.push_back(lean_check);
  if (report.inflation > 1.0)
    verdict.checks.push_back(check("inflated", State::care,
                                   "every σ was raised by " + text_of(std::sqrt(report.inflation), 3) +
                                       ": the innovations are larger than stated, or follow one another",
                                   std::sqrt(report.inflation), 1.0, "1"));
}

/// Only a comparison with the truth shows a wrong focal length, as a following head keeps the target centred.
Check truth_check(const TrackReport& report) {
  const double nees = report.nees_per_dof, ratio = std::sqrt(nees);
  const double max_good = report.errors_are_counted ? good_nees_of_one : good_nees;
  return check("truth",
               nees > max_nees   ? State::bad
               : nees > max_good ? State::care
                                 : State::good,
               "the errors are " + text_of(ratio, 2) + " times their σ", ratio, std::sqrt(max_good), "σ");
}

void add_checks(const TrackReport& report, bool is_stated, Verdict& verdict) {
  if (std::isfinite(report.nis_per_dof)) verdict.checks.push_back(nis_check(report, is_stated));
  if (std::isfinite(report.nees_per_dof)) verdict.checks.push_back(truth_check(report));
  const auto num_alone = static_cast<double>(count(report, TrackEvent::one_head));
  const double alone = num_alone / static_cast<double>(report.steps.size());
  verdict.checks.push_back(check("both heads", alone > 0.02 ? State::care : State::good,
                                 alone > 0.0
                                     ? text_of(100.0 * alone, 2) + " % seen by one head only: range drifts there"
                                     : "both heads see the target",
                                 alone, 0.02, "1"));
  const double rejected = 1.0 - used_share(report);
  const std::size_t num_left = report.steps.size() - report.num_used;
  verdict.checks.push_back(
      check("rejected",
            rejected > max_rejected    ? State::bad
            : rejected > care_rejected ? State::care
                                       : State::good,
            std::to_string(num_left) + " of " + std::to_string(report.steps.size()) + " observations (" +
                text_of(100.0 * rejected, 2) + " %) were rejected: " +
                (rejected > care_rejected ? "what agrees is no more than what was let in" : "the others agree"),
            rejected, care_rejected, "1"));
  const auto late = static_cast<double>(count(report, TrackEvent::late));
  if (late > 0.0)
    verdict.checks.push_back(
        check("late", State::care, text_of(late, 2) + " observations came too late", late, 0.0, "observations"));
}

/// Rejected observations that follow a path of their own.
std::optional<Check> second_target(const TrackReport& report, std::span<const TargetObservation> observations,
                                   std::span<const RigHead> heads, const FollowConfig& config) {
  constexpr std::size_t least = 16;
  constexpr double min_share = 0.7;
  Observations others;
  for (std::size_t i = 0; i < observations.size() && i < report.steps.size(); ++i)
    if (report.steps[i].event == TrackEvent::gated || report.steps[i].event == TrackEvent::depth)
      others.push_back(observations[i]);
  if (others.size() < least) return std::nullopt;
  FollowConfig plain = config;
  plain.judge = false;
  const TrackReport second = track_target(with_shift(others, {}), heads, plain);
  if (second.num_starts == 0 || used_share(second) < min_share || second.num_restarts * 20 > others.size())
    return std::nullopt;
  return check("second target", State::care,
               "there are two targets: " + std::to_string(second.num_used) + " of the " +
                   std::to_string(others.size()) + " observations that were rejected follow a path of their own",
               used_share(second), min_share, "1");
}

/// What is wrong with the observations as a whole.
struct Causes {
  std::optional<Fault> mistake;
  std::optional<Check> second, falls, coarse;
  std::optional<ClockShift> shift;
  std::optional<OtherObject> other;
  std::optional<VelocityJumps> jumps;
  double step_s = 0.0;  ///< Rounding step of all times, if that explains as much.
};

bool is_doubtful(const TrackReport& report) {
  return !fits(report) || report.inflation > 1.0 || used_share(report) < 1.0 - care_rejected ||
         !alike_per_head(report).empty();
}

Causes causes_of(const TrackReport& report, std::span<const TargetObservation> observations,
                 std::span<const RigHead> heads, const FollowConfig& config) {
  FollowConfig found = config;
  if (report.num_starts > 0) found.tracker.sigma_a_m_s2 = report.sigma_a_m_s2;
  Causes causes;
  const bool is_explained = is_explained_by_fault(report);
  if (report.num_starts > 0 && (is_doubtful(report) || report.num_restarts > 0 || report.jitter)) {
    causes.mistake = exchanged_rows(observations, heads, found);
    if (!causes.mistake) causes.mistake = misread_table(observations, heads, found, alike_per_head(report));
    if (causes.mistake) return causes;
  }
  if (report.num_starts > 0) causes.coarse = coarse_readings(observations, heads, config);
  if (causes.coarse) return causes;
  if (report.num_starts > 0 && !is_explained && report.frozen.empty() && is_doubtful(report))
    causes.other = other_object(observations, heads, config, report);
  if (causes.other) return causes;
  if (report.num_restarts > 1) causes.jumps = velocity_jumps(report.steps, config.tracker);
  if (causes.jumps && fits(report)) {
    if (config.tracker.method != TargetMotion::ballistic) causes.falls = falling_target(observations, heads, config);
    return causes;
  }
  if (is_explained && !fits(report)) return causes;
  const bool is_odd = !fits(report) || report.nis_per_dof > good_nis_high || used_share(report) < 1.0 - care_rejected;
  const bool is_jitter = report.jitter && fits(report);
  if (is_odd && !is_explained && !is_jitter) causes.mistake = explanation_of(observations, heads, config, fits(report));
  if (causes.mistake && !causes.mistake->is_foreign_head) return causes;
  causes.shift = probable_clock_shift(observations, heads, found, rivals_of_clocks(report));
  // A head with a wrong clock also agrees with none of the others.
  if (causes.mistake && !causes.shift) return causes;
  causes.mistake.reset();
  if (causes.shift && causes.shift->is_worse_than_rival() && !alike_per_head(report).empty()) causes.shift.reset();
  if (is_explained || is_jitter) return causes;
  causes.second = second_target(report, observations, heads, found);
  constexpr double half_gravity_m_s2 = 5.0;  // a falling target requires as much, even with larger noise
  const bool may_fall = report.sigma_px_is_found && report.sigma_a_m_s2 > half_gravity_m_s2;
  if (report.num_restarts > 0 || report.nis_per_dof > good_nis_high || may_fall)
    causes.falls = falling_target(observations, heads, config);
  return causes;
}

std::string clocks_text(const Causes& causes, std::span<const RigHead> heads) {
  return clock_text(*causes.shift, heads) + (causes.step_s > 0.0 ? "; " + rounding_text(causes.step_s) : "");
}

/// Bad if the track followed the other object.
void add_other(const OtherObject& other, std::span<const RigHead> heads, Verdict& verdict) {
  constexpr double max_sigma = 5.0;
  verdict.checks.push_back(check("other object", other.moved_in_sigma > max_sigma ? State::bad : State::care,
                                 other_object_text(other, heads), other.moved_in_sigma, max_sigma, "σ"));
}

void add_clocks(const TrackReport& report, const Causes& causes, std::span<const RigHead> heads, Verdict& verdict) {
  if (causes.shift)
    verdict.checks.push_back(
        check("clocks", State::care, clocks_text(causes, heads), 1e3 * causes.shift->later_s, 0.0, "ms"));
  else if (causes.step_s > 0.0)
    verdict.checks.push_back(check("times", State::care, rounding_text(causes.step_s), 1e3 * causes.step_s, 0.0, "ms"));
  if (report.rounded && !(causes.step_s > 0.0)) verdict.checks.push_back(rounded_check(*report.rounded));
}

/// What to do about times that differ from those of the images; their scatter matters less than their delay.
void set_times_remedy(const TrackReport& report, const Causes& causes, Verdict& verdict) {
  if (causes.step_s > 0.0) verdict.to_add = rounding_remedy(causes.step_s);
  if (report.jitter) verdict.to_add = jitter_remedy();
  if (report.rounded && verdict.state > State::good && (verdict.to_add.empty() || report.jitter))
    verdict.to_add = rounding_remedy(report.rounded->step_s);
}

/// Why there is no track.
std::optional<Fault> refusal_of(const TrackReport& report, const Causes& causes,
                                std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const FollowConfig& config) {
  // If nothing moves relative to the heads, many mistakes would make the rays meet, which explains nothing.
  if (report.num_starts == 0 && are_parallel(observations, heads, config))
    return why_no_start(observations, heads, config);
  const double late = static_cast<double>(count(report, TrackEvent::late)) / static_cast<double>(report.steps.size());
  if (late > max_rejected)
    return Fault{text_of(100.0 * late, 2) + " % of the observations come more than " +
                     text_of(config.tracker.history_s, 2) + " s after others that were taken later",
                 "give them in order of capture, or check t_capture_s of each head: their clocks may differ by that"};
  if (causes.other && !fits(report))
    return Fault{other_object_text(*causes.other, heads), other_object_remedy(*causes.other, heads)};
  if (causes.coarse && !fits(report)) return Fault{causes.coarse->text, coarse_readings_remedy(*causes.coarse)};
  if (causes.mistake && (!fits(report) || used_share(report) < 1.0 - max_rejected)) return causes.mistake;
  if (is_explained_by_fault(report) && !fits(report))
    return Fault{"only " + text_of(100.0 * used_share(report), 2) +
                     " % of the observations fit one track and this rig: " + fault_text(report),
                 fault_remedy(report, heads)};
  if (fits(report)) return std::nullopt;
  if (causes.shift)
    return Fault{clocks_text(causes, heads),
                 causes.step_s > 0.0 ? rounding_remedy(causes.step_s) : "set the heads' clocks"};
  if (report.num_starts == 0) return why_no_start(observations, heads, config);
  if (causes.second) return Fault{causes.second->text, "give the observations of one target: one row per image"};
  if (used_share(report) < min_used_share)
    return Fault{"only " + text_of(100.0 * used_share(report), 2) +
                     " % of the observations fit one track and this rig, and no clock, sign or swap explains it",
                 "check that the rig file is of these heads as they are now, and the noise"};
  return std::nullopt;
}

std::string sentence_of(const TrackReport& report, std::size_t num_given, const Verdict& verdict) {
  std::string sentence =
      "tracked through " + std::to_string(report.num_used) + " of " + std::to_string(num_given) + " observations";
  if (report.num_restarts > 0) sentence += ", started again " + std::to_string(report.num_restarts) + " times";
  if (verdict.state == State::good) return sentence;
  const auto first = std::ranges::find(verdict.checks, verdict.state, &Check::state);
  sentence += "; " + first->text;
  // Adds a likely cause to checks that only state the extent.
  constexpr std::array<std::string_view, 12> names{"frozen", "encoder", "other object",  "bounces", "jitter", "times",
                                                   "clocks", "mistake", "second target", "falls",   "rig",    "lean"};
  const auto cause = std::ranges::find_if(
      verdict.checks, [&](const Check& c) { return c.state != State::good && std::ranges::count(names, c.name) > 0; });
  if (cause != verdict.checks.end() && cause != first) sentence += "; " + cause->text;
  return sentence;
}

/// A wrong rig can also look like a falling target: the one that explains more of the likelihood is named first.
void put_likelier_first(Verdict& verdict) {
  const auto falls = std::ranges::find(verdict.checks, "falls", &Check::name);
  const auto rig = std::ranges::find(verdict.checks, "rig", &Check::name);
  if (falls == verdict.checks.end() || rig == verdict.checks.end() || rig->state == State::good) return;
  if (0.5 * rig->value * rig->value > falls->value) std::rotate(falls, falls + 1, verdict.checks.end());
}

/// The report and observations of what was followed, without the excluded rows.
struct Followed {
  TrackReport report;
  Observations observations;

  Followed(const TrackReport& all, std::span<const TargetObservation> given) : report(all) {
    report.steps.clear();
    for (std::size_t i = 0; i < given.size() && i < all.steps.size(); ++i) {
      if (all.steps[i].event == TrackEvent::frozen) continue;
      report.steps.push_back(all.steps[i]);
      observations.push_back(given[i]);
    }
  }
};

void add_frozen(const TrackReport& report, std::span<const RigHead> heads, Verdict& verdict) {
  for (const FrozenRows& one : report.frozen)
    verdict.checks.push_back(check("frozen", one.agrees ? State::good : State::care, frozen_text(one, heads),
                                   static_cast<double>(one.num), 0.0, "rows"));
}

/// What to do about the first frozen rows that the others contradict.
void set_frozen_remedy(const TrackReport& report, std::span<const RigHead> heads, Verdict& verdict) {
  const auto first = std::ranges::find(report.frozen, false, &FrozenRows::agrees);
  if (first != report.frozen.end()) verdict.to_add = frozen_remedy(*first, heads);
}

Verdict verdict_of(const TrackReport& report, std::span<const TargetObservation> observations,
                   std::span<const RigHead> heads, const FollowConfig& config, bool is_stated, std::size_t num_given) {
  if (auto copied = copied_pixels(observations, heads)) return refused(std::move(*copied));
  if (auto other = other_camera(report, observations, heads)) {
    const auto misread = explanation_of(observations, heads, config, /*fits=*/false);  // larger images, or exchanged
    return refused(misread ? *misread : std::move(*other));
  }
  if (const auto unit = units_of_heads_times(observations, heads, config)) return refused({unit->text, unit_remedy});
  Causes causes = causes_of(report, observations, heads, config);
  if (!causes.mistake) causes.step_s = step_that_explains(observations, report, causes.shift);
  const auto unit = unit_of_times(observations, heads, config);
  if (unit && !fits(report)) return refused({unit->text, unit_remedy});
  if (auto why = refusal_of(report, causes, observations, heads, config)) return refused(std::move(*why));
  Verdict verdict;
  if (unit) verdict.checks.push_back(*unit);
  add_frozen(report, heads, verdict);
  if (causes.other) add_other(*causes.other, heads, verdict);
  if (causes.jumps) verdict.checks.push_back(velocity_jumps_check(*causes.jumps));
  if (causes.jumps && causes.falls) verdict.checks.back().text += "; " + causes.falls->text;
  if (report.jitter && !causes.mistake && !causes.jumps && !causes.coarse)
    verdict.checks.push_back(check("jitter", State::care, jitter_text(*report.jitter, step_of_times(observations)),
                                   1e3 * report.jitter->sigma_s, 0.0, "ms"));
  add_clocks(report, causes, heads, verdict);
  if (causes.mistake) verdict.checks.push_back(check("mistake", State::bad, causes.mistake->what, 1.0, 0.0, "1"));
  if (causes.second) verdict.checks.push_back(*causes.second);
  if (causes.falls && !causes.jumps) verdict.checks.push_back(*causes.falls);
  add_checks(report, is_stated, verdict);
  add_white(report, heads, verdict);
  put_likelier_first(verdict);
  for (const Check& c : verdict.checks) verdict.state = std::max(verdict.state, c.state);
  if (verdict.state == State::good) causes.coarse.reset();
  if (causes.coarse) verdict.checks.insert(verdict.checks.begin(), *causes.coarse);
  if (!alike_per_head(report).empty()) verdict.to_add = fault_remedy(report, heads);
  set_times_remedy(report, causes, verdict);
  set_frozen_remedy(report, heads, verdict);
  if (verdict.state == State::bad) verdict.to_add = "do not use it before the reason is found";
  if (causes.coarse) verdict.to_add = coarse_readings_remedy(*causes.coarse);
  if (causes.mistake) verdict.to_add = causes.mistake->to_do;
  if (causes.other) verdict.to_add = other_object_remedy(*causes.other, heads);
  if (causes.jumps) verdict.to_add = velocity_jumps_remedy;
  if (unit) verdict.to_add = unit_remedy;
  verdict.sentence = sentence_of(report, num_given, verdict);
  return verdict;
}

}  // namespace

Verdict track_verdict(const TrackReport& report, std::span<const TargetObservation> observations,
                      std::span<const RigHead> heads, const FollowConfig& config) {
  std::set<std::size_t> seen_by;
  for (const TargetObservation& observation : observations) seen_by.insert(observation.head);
  if (seen_by.size() < 2)
    return refused({"one head only: the range along its ray cannot be determined", "add the events of a second head"});
  FollowConfig used = config;
  used.find_sigma_px = false;
  if (report.sigma_px_is_found) used.tracker.sigma_px = report.sigma_px;
  const auto states_own = [](const TargetObservation& observation) { return observation.sigma_px > 0.0; };
  const bool is_stated = !config.find_sigma_px || !config.find_sigma_a || std::ranges::any_of(observations, states_own);
  if (report.frozen.empty()) return verdict_of(report, observations, heads, used, is_stated, report.steps.size());
  const Followed followed(report, observations);
  return verdict_of(followed.report, followed.observations, heads, used, is_stated, report.steps.size());
}

}  // namespace alidade
