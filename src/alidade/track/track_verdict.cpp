#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>
#include <set>
#include <string>

#include "alidade/track/clock_shift.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

constexpr double good_nees = 2.0, most_nees = 9.0;  // per degree of freedom, where the truth is given
constexpr double least_used_share = 0.7, most_nis = 3.0, good_nis_low = 0.6, good_nis_high = 1.5;

double used_share(const TrackReport& report) {
  return report.steps.empty() ? 0.0 : static_cast<double>(report.num_used) / static_cast<double>(report.steps.size());
}

std::size_t count(const TrackReport& report, TrackEvent event) {
  return static_cast<std::size_t>(std::ranges::count(report.steps, event, &TrackStep::event));
}

bool fits(const TrackReport& report) {
  return report.num_starts > 0 && used_share(report) > least_used_share && !(report.nis_per_dof > most_nis) &&
         report.num_restarts * 20 <= report.steps.size();
}

using Sights = std::vector<TargetSight>;

Sights in_degrees(Sights sights) {
  for (TargetSight& sight : sights) sight.pan_tilt_rad *= std::numbers::pi / 180.0;
  return sights;
}
Sights swapped(Sights sights) {
  for (TargetSight& sight : sights) sight.head = sight.head < 2 ? 1 - sight.head : sight.head;
  return sights;
}
Sights pan_reversed(Sights sights) {
  for (TargetSight& sight : sights) sight.pan_tilt_rad.x() *= -1.0;
  return sights;
}
Sights tilt_reversed(Sights sights) {
  for (TargetSight& sight : sights) sight.pan_tilt_rad.y() *= -1.0;
  return sights;
}

struct Fault {
  std::string what, add;
};

/// The mistake that would explain sights that do not fit: the one under which they do.
std::optional<Fault> likely_mistake(std::span<const TargetSight> sights, std::span<const RigHead> heads,
                                    const TrackConfig& config) {
  struct Candidate {
    Sights (*apply)(Sights);
    const char *what, *add;
  };
  const Candidate candidates[] = {
      {in_degrees, "angles in degrees", "give pan_rad and tilt_rad in radians: as degrees they fit the rig"},
      {swapped, "heads swapped", "exchange the two heads' names in the events or in the rig: then they fit"},
      {pan_reversed, "pan with the wrong sign", "pan > 0 turns left: with the sign reversed the events fit the rig"},
      {tilt_reversed, "tilt with the wrong sign", "tilt > 0 turns up: with the sign reversed the events fit the rig"}};
  const Sights given(sights.begin(), sights.end());
  for (const Candidate& candidate : candidates) {
    if (fits(track_target(candidate.apply(given), heads, config))) return Fault{candidate.what, candidate.add};
  }
  return std::nullopt;
}

/// Why no track began although there were two heads at a time.
Fault why_no_start(std::span<const TargetSight> sights, std::span<const RigHead> heads, const TrackConfig& config) {
  std::size_t together = 0, parallel = 0;
  for (std::size_t i = 1; i < sights.size(); ++i) {
    const TargetSight &a = sights[i - 1], &b = sights[i];
    if (a.head == b.head || a.head >= heads.size() || b.head >= heads.size() ||
        std::abs(a.t_capture_s - b.t_capture_s) > config.tracker.together_s)
      continue;
    ++together;
    const auto ray_a = ray_in_world(heads[a.head], a.pan_tilt_rad, a.px);
    const auto ray_b = ray_in_world(heads[b.head], b.pan_tilt_rad, b.px);
    if (ray_a && ray_b && !nearest_to_rays(*ray_a, *ray_b)) ++parallel;
  }
  if (together == 0)
    return {
        "the heads never see the target within " + text_of(1e3 * config.tracker.together_s, 2) + " ms of each other",
        "take pictures more often, or set their clocks"};
  if (2 * parallel > together)
    return {"parallel rays: the heads look in the same direction, so that the range cannot be told",
            "set the heads further apart, or let the target come nearer"};
  return {"the two heads' rays do not meet within " + text_of(config.tracker.min_depth_m, 2) + " to " +
              text_of(config.tracker.max_depth_m, 2) + " m",
          "check the rig file, or widen the working range"};
}

std::string clock_text(const ClockShift& shift, std::span<const RigHead> heads) {
  return "the clock of head " + std::to_string(heads[shift.head].head.id) + " seems " +
         text_of(1e3 * std::abs(shift.later_s), 2) + " ms " + (shift.later_s > 0.0 ? "behind" : "ahead of") +
         " that of head " + std::to_string(heads[0].head.id) +
         ": with its times moved by that the sights are far more probable";
}

/// Pixels beyond the picture of the rig's camera: the rig file is of another camera.
std::optional<Fault> other_camera(const TrackReport& report, std::span<const TargetSight> sights,
                                  std::span<const RigHead> heads) {
  constexpr double most_share = 0.05;
  for (std::size_t h = 0; h < heads.size(); ++h) {
    double num = 0.0, outside = 0.0;
    for (std::size_t i = 0; i < sights.size() && i < report.steps.size(); ++i) {
      if (sights[i].head != h) continue;
      num += 1.0;
      outside += report.steps[i].event == TrackEvent::outside ? 1.0 : 0.0;
    }
    if (!(outside > most_share * num)) continue;
    return Fault{text_of(100.0 * outside / num) + " % of the sights of head " + std::to_string(heads[h].head.id) +
                     " lie outside its picture of " + std::to_string(heads[h].camera.width_px) + " x " +
                     std::to_string(heads[h].camera.height_px) + " px",
                 "give the rig file of the camera that took them"};
  }
  return std::nullopt;
}

Verdict refused(Fault fault) {
  Verdict verdict;
  verdict.state = State::refused;
  verdict.exit_code = ExitCode::cannot_tell;
  verdict.sentence = std::move(fault.what);
  verdict.to_add = std::move(fault.add);
  return verdict;
}

Check check(std::string name, State state, std::string text, double value, double limit, std::string unit) {
  return {std::move(name), state, std::move(text), value, limit, std::move(unit), "track"};
}

void add_checks(const TrackReport& report, Verdict& verdict) {
  const double nis = report.nis_per_dof;
  if (std::isfinite(nis)) {
    const bool is_good = nis >= good_nis_low && nis <= good_nis_high;
    const std::string text = nis > good_nis_high  ? "noise is larger than stated, or the rig is wrong"
                             : nis < good_nis_low ? "noise is smaller than stated"
                                                  : "innovations as large as predicted";
    verdict.checks.push_back(check("NIS",
                                   is_good          ? State::good
                                   : nis > most_nis ? State::bad
                                                    : State::care,
                                   text_of(nis, 3) + " per degree of freedom: " + text, nis, good_nis_high, "1"));
  }
  const double nees = report.nees_per_dof;
  if (std::isfinite(
          nees)) {  // only who has the truth sees a wrong focal length: a head that follows keeps the target central
    const double ratio = std::sqrt(nees);
    verdict.checks.push_back(check("truth",
                                   nees > most_nees   ? State::bad
                                   : nees > good_nees ? State::care
                                                      : State::good,
                                   "the errors are " + text_of(ratio, 2) + " times their σ", ratio,
                                   std::sqrt(good_nees), "σ"));
  }
  const auto num_alone = static_cast<double>(count(report, TrackEvent::one_head));
  const double alone = num_alone / static_cast<double>(report.steps.size());
  verdict.checks.push_back(check("both heads", alone > 0.02 ? State::care : State::good,
                                 alone > 0.0
                                     ? text_of(100.0 * alone, 2) + " % seen by one head only: range drifts there"
                                     : "both heads see the target",
                                 alone, 0.02, "1"));
  const double left_out = 1.0 - used_share(report);
  verdict.checks.push_back(check("left out", left_out > 0.05 ? State::care : State::good,
                                 text_of(100.0 * left_out, 2) + " % of the sights left out", left_out, 0.05, "1"));
  const auto late = static_cast<double>(count(report, TrackEvent::late));
  if (late > 0.0)
    verdict.checks.push_back(
        check("late", State::care, text_of(late, 2) + " sights came too late", late, 0.0, "sights"));
}

}  // namespace

Verdict track_verdict(const TrackReport& report, std::span<const TargetSight> sights, std::span<const RigHead> heads,
                      const TrackConfig& config) {
  std::set<std::size_t> seen_by;
  for (const TargetSight& sight : sights) seen_by.insert(sight.head);
  if (seen_by.size() < 2)
    return refused({"one head only: the range along its ray cannot be told", "add the events of a second head"});
  if (auto other = other_camera(report, sights, heads)) return refused(std::move(*other));
  if (!fits(report)) {
    if (auto mistake = likely_mistake(sights, heads, config)) return refused(std::move(*mistake));
    if (report.num_starts == 0) return refused(why_no_start(sights, heads, config));
    if (const auto shift = probable_clock_shift(sights, heads, config))
      return refused({clock_text(*shift, heads), "set the heads' clocks"});
    if (used_share(report) < least_used_share)
      return refused({"only " + text_of(100.0 * used_share(report), 2) + " % of the sights fit one track and this rig",
                      "check the rig file, the heads' clocks and the noise"});
  }
  Verdict verdict;
  add_checks(report, verdict);
  if (const auto shift = probable_clock_shift(sights, heads, config))
    verdict.checks.insert(verdict.checks.begin(),
                          check("clocks", State::care, clock_text(*shift, heads), 1e3 * shift->later_s, 0.0, "ms"));
  for (const Check& c : verdict.checks) verdict.state = std::max(verdict.state, c.state);
  verdict.sentence =
      "tracked through " + std::to_string(report.num_used) + " of " + std::to_string(report.steps.size()) + " sights";
  if (report.num_restarts > 0) verdict.sentence += ", begun anew " + std::to_string(report.num_restarts) + " times";
  for (const Check& c : verdict.checks) {
    if (c.state == verdict.state && c.state != State::good) {
      verdict.sentence += "; " + c.text;
      break;
    }
  }
  return verdict;
}

}  // namespace alidade
