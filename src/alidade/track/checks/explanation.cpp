#include "alidade/track/checks/explanation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <functional>
#include <limits>
#include <numbers>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/track/checks/clock_shift.h"

namespace alidade {
namespace {

using Observations = std::vector<TargetObservation>;

struct Hypothesis {
  Explanation explanation;
  std::function<void(TargetObservation&)> apply;
};

struct Trial {
  double ln_p = -std::numeric_limits<double>::infinity();
  bool fits = false;
};

/// How the observations fare, the target being as manoeuvring as suits them best.
Trial tried(const Observations& observations, std::span<const RigHead> heads, const FollowConfig& config) {
  constexpr double min_used = 0.9, nis_that_fits = 1.7, max_restarts = 0.01;
  Trial best;
  FollowConfig plain = config;
  plain.judge = plain.find_sigma_a = false;
  for (const double sigma_a : {0.1, 1.0, 8.0}) {
    plain.tracker.sigma_a_m_s2 = config.find_sigma_a ? sigma_a : config.tracker.sigma_a_m_s2;
    const TrackReport report = track_target(observations, heads, plain);
    const double num = static_cast<double>(observations.size()), gate = plain.tracker.gate;
    double ln_p = 0.0;
    for (const TrackStep& step : report.steps) {
      ln_p -= step.has_innovation
                  ? 0.5 * (std::min(step.innovation.nis, gate) + std::log(step.innovation.S.determinant()))
                  : 0.5 * gate;
      if (step.event == TrackEvent::restart) ln_p -= gate;
    }
    if (ln_p > best.ln_p) {
      best.ln_p = ln_p;
      best.fits = report.num_starts > 0 && static_cast<double>(report.num_used) > min_used * num &&
                  report.nis_per_dof < nis_that_fits && static_cast<double>(report.num_restarts) <= max_restarts * num;
    }
    if (!config.find_sigma_a) break;
  }
  return best;
}

std::string head_name(std::span<const RigHead> heads, std::size_t head) {
  return "head " + std::to_string(heads[head].head.id);
}

/// The signs and mirrors of one head, or of all.
void add_turned(std::span<const RigHead> heads, std::optional<std::size_t> head, std::vector<Hypothesis>& all) {
  const std::string of = head ? " of " + head_name(heads, *head) : "";
  const auto add = [&](const std::string& what, const std::string& to_do,
                       std::function<void(TargetObservation&)> change) {
    all.push_back({{what, to_do}, [head, change](TargetObservation& observation) {
                     if (!head || observation.head == *head) change(observation);
                   }});
  };
  add("pan" + of + " with the wrong sign", "pan > 0 turns left: with the sign reversed the events fit the rig",
      [](TargetObservation& observation) { observation.pan_tilt_rad.x() *= -1.0; });
  add("tilt" + of + " with the wrong sign", "tilt > 0 turns up: with the sign reversed the events fit the rig",
      [](TargetObservation& observation) { observation.pan_tilt_rad.y() *= -1.0; });
  const auto mirrored = [heads](TargetObservation& observation, int axis) {
    const Camera& camera = heads[observation.head].camera;
    observation.px[axis] = (axis == 0 ? camera.width_px : camera.height_px) - 1.0 - observation.px[axis];
  };
  const std::string whose = head ? head_name(heads, *head) : "all heads";
  add("the images of " + whose + " are mirrored", "mirror u: then the events fit the rig",
      [mirrored](TargetObservation& observation) { mirrored(observation, 0); });
  add("the images of " + whose + " are flipped upside down", "mirror v: then the events fit the rig",
      [mirrored](TargetObservation& observation) { mirrored(observation, 1); });
  add("the images of " + whose + " are rotated by half a turn",
      "that camera hangs upside down: mirror u and v, or say so in the rig's cam_from_tilt",
      [mirrored](TargetObservation& observation) {
        mirrored(observation, 0);
        mirrored(observation, 1);
      });
}

std::vector<Hypothesis> hypotheses(std::span<const RigHead> heads) {
  std::vector<Hypothesis> all;
  all.push_back({{"angles in degrees", "give pan_rad and tilt_rad in radians: as degrees they fit the rig"},
                 [](TargetObservation& observation) { observation.pan_tilt_rad *= std::numbers::pi / 180.0; }});
  const std::size_t num = std::min<std::size_t>(heads.size(), 4);
  for (std::size_t a = 0; a < num; ++a)
    for (std::size_t b = a + 1; b < num; ++b)
      all.push_back({{num == 2 ? "heads swapped" : head_name(heads, a) + " and " + head_name(heads, b) + " swapped",
                      "exchange the two heads' names in the events or in the rig: then they fit"},
                     [a, b](TargetObservation& observation) {
                       observation.head = observation.head == a ? b : observation.head == b ? a : observation.head;
                     }});
  add_turned(heads, std::nullopt, all);
  for (std::size_t head = 0; head < num; ++head) add_turned(heads, head, all);
  return all;
}

/// Of three heads or more the one without which the others' observations fit.
std::optional<Explanation> foreign_head(const Observations& observations, std::span<const RigHead> heads,
                                        const FollowConfig& config) {
  std::optional<Explanation> found;
  for (std::size_t head = 0; heads.size() > 2 && head < heads.size(); ++head) {
    Observations others = observations;
    std::erase_if(others, [&](const TargetObservation& observation) { return observation.head == head; });
    if (others.size() == observations.size() || !tried(others, heads, config).fits) continue;
    if (found) return std::nullopt;  // of two that could be it neither is named
    found = {
        "the observations of " + head_name(heads, head) + " agree with none of the other heads, which agree",
        "its row in the rig file is that of another head, or its events are: remove it, or calibrate at its present "
        "position again",
        true};
  }
  return found;
}

}  // namespace

std::string clock_text(const ClockShift& shift, std::span<const RigHead> heads) {
  const std::string others = heads.size() > 2  ? "those of the others"
                             : shift.head == 1 ? "that of head " + std::to_string(heads[0].head.id)
                                               : "that of head " + std::to_string(heads[1].head.id);
  const std::string rival = "that " + shift.rival + " is off by " + text_of(std::abs(shift.rival_off), 2);
  if (shift.is_worse_than_rival())
    return rival + " makes the observations far more probable, more than another time of a clock does";
  return "the clock of " + head_name(heads, shift.head) + " seems " + text_of(1e3 * std::abs(shift.later_s), 2) +
         " ms " + (shift.later_s > 0.0 ? "behind" : "ahead of") + " " + others +
         ": with its times moved by that the observations are far more probable" +
         (shift.rival.empty() ? "" : "; " + rival + " explains them as well");
}

std::optional<Explanation> explanation_of(std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, const FollowConfig& config) {
  constexpr std::size_t max_observations = 1200, first_observations = 160;
  constexpr double min_gain = 30.0, clear = 15.0;
  Observations given = with_shift(observations.first(std::min(observations.size(), max_observations)), {});
  std::erase_if(given, [&](const TargetObservation& observation) { return observation.head >= heads.size(); });
  const double as_given = tried(given, heads, config).ln_p;
  std::vector<std::pair<double, Explanation>> fitting;
  for (const Hypothesis& hypothesis : hypotheses(heads)) {
    Observations changed = given;
    for (TargetObservation& observation : changed) hypothesis.apply(observation);
    changed = with_shift(changed, {});
    // What does not fit a few hundred observations does not fit all of them.
    const Observations some(
        changed.begin(), changed.begin() + static_cast<std::ptrdiff_t>(std::min(changed.size(), first_observations)));
    if (changed.size() > 2 * first_observations && !tried(some, heads, config).fits) continue;
    const Trial trial = tried(changed, heads, config);
    if (trial.fits && trial.ln_p > as_given + min_gain) fitting.emplace_back(trial.ln_p, hypothesis.explanation);
  }
  if (fitting.empty()) return foreign_head(given, heads, config);
  std::ranges::stable_sort(fitting, std::ranges::greater{}, &std::pair<double, Explanation>::first);
  Explanation best = fitting.front().second;
  if (fitting.size() > 1 && fitting[1].first > fitting[0].first - clear)
    best = {best.what + ", or " + fitting[1].second.what, best.to_do};
  return best;
}

namespace {

/// How many pairs of observations there are at a time, and of them, with parallel rays.
struct PairCounts {
  std::size_t together = 0, parallel = 0;
};

PairCounts count_pairs(std::span<const TargetObservation> given, std::span<const RigHead> heads,
                       const FollowConfig& config) {
  PairCounts counts;
  std::vector<TargetObservation> observations(given.begin(), given.end());
  std::ranges::stable_sort(observations, {}, &TargetObservation::t_capture_s);
  for (std::size_t i = 1; i < observations.size(); ++i) {
    const TargetObservation &a = observations[i - 1], &b = observations[i];
    if (a.head == b.head || a.head >= heads.size() || b.head >= heads.size() ||
        std::abs(a.t_capture_s - b.t_capture_s) > config.tracker.together_s)
      continue;
    ++counts.together;
    const auto ray_a = ray_in_world(heads[a.head], a);
    const auto ray_b = ray_in_world(heads[b.head], b);
    if (ray_a && ray_b && !nearest_to_rays(*ray_a, *ray_b)) ++counts.parallel;
  }
  return counts;
}

}  // namespace

bool are_parallel(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                  const FollowConfig& config) {
  const PairCounts counts = count_pairs(observations, heads, config);
  return 2 * counts.parallel > counts.together;
}

Explanation why_no_start(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                         const FollowConfig& config) {
  const auto [together, parallel] = count_pairs(observations, heads, config);
  if (together == 0)
    return {
        "the heads never see the target within " + text_of(1e3 * config.tracker.together_s, 2) + " ms of each other",
        "take images more often, or set their clocks"};
  if (2 * parallel > together)
    return {"parallel rays: the heads look in the same direction, so that the range cannot be determined",
            "set the heads further apart, or let the target come nearer"};
  return {"the two heads' rays do not meet within " + text_of(config.tracker.min_depth_m, 2) + " to " +
              text_of(config.tracker.max_depth_m, 2) + " m",
          "check the rig file, or widen the working range"};
}

}  // namespace alidade
