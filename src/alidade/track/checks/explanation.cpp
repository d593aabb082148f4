#include "alidade/track/checks/explanation.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/track/checks/clock_shift.h"
#include "alidade/track/checks/rig_faults.h"

namespace alidade {

Trial tried(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
            const FollowConfig& config) {
  constexpr double min_used = 0.9, nis_that_fits = 1.7, max_restarts = 0.01;
  Trial best{.ln_p = -std::numeric_limits<double>::infinity()};
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

namespace {

using Observations = std::vector<TargetObservation>;

std::string head_name(std::span<const RigHead> heads, std::size_t head) {
  return "head " + std::to_string(heads[head].head.id);
}

using Change = std::function<void(TargetObservation&)>;

/// A misreading of one head's observations, or of all.
TableMisreading misreading_of(std::optional<std::size_t> head, const std::string& what, const std::string& to_do,
                              const Change& change) {
  return {{what, to_do}, [head, change](TargetObservation& observation) {
            if (!head || observation.head == *head) change(observation);
          }};
}

/// Wrong signs of one head's angles, or of all heads'.
void add_signs(std::span<const RigHead> heads, std::optional<std::size_t> head, std::vector<TableMisreading>& all) {
  const std::string of = head ? " of " + head_name(heads, *head) : "";
  all.push_back(misreading_of(head, "pan" + of + " with the wrong sign",
                              "pan > 0 turns left: with the sign reversed the events fit the rig",
                              [](TargetObservation& observation) { observation.pan_tilt_rad.x() *= -1.0; }));
  all.push_back(misreading_of(head, "tilt" + of + " with the wrong sign",
                              "tilt > 0 turns up: with the sign reversed the events fit the rig",
                              [](TargetObservation& observation) { observation.pan_tilt_rad.y() *= -1.0; }));
}

/// Mirrored images of one head, or of all.
void add_mirrors(std::span<const RigHead> heads, std::optional<std::size_t> head, std::vector<TableMisreading>& all) {
  const auto mirrored = [heads](TargetObservation& observation, int axis) {
    const Camera& camera = heads[observation.head].camera;
    observation.px[axis] = (axis == 0 ? camera.width_px : camera.height_px) - 1.0 - observation.px[axis];
  };
  const std::string images = "the images of " + (head ? head_name(heads, *head) : "all heads");
  all.push_back(misreading_of(head, images + " are mirrored", "mirror u: then the events fit the rig",
                              [mirrored](TargetObservation& observation) { mirrored(observation, 0); }));
  all.push_back(misreading_of(head, images + " are flipped upside down", "mirror v: then the events fit the rig",
                              [mirrored](TargetObservation& observation) { mirrored(observation, 1); }));
  all.push_back(misreading_of(head, images + " are rotated by half a turn",
                              "that camera hangs upside down: mirror u and v, or say so in the rig's cam_from_tilt",
                              [mirrored](TargetObservation& observation) {
                                mirrored(observation, 0);
                                mirrored(observation, 1);
                              }));
}

/// Exchanged columns of one head, or of all.
void add_exchanges(std::span<const RigHead> heads, std::optional<std::size_t> head, std::vector<TableMisreading>& all) {
  const std::string of = head ? " of " + head_name(heads, *head) : "";
  all.push_back(misreading_of(
      head, "pan and tilt" + of + " exchanged", "exchange pan_rad and tilt_rad: then the events fit the rig",
      [](TargetObservation& observation) { std::swap(observation.pan_tilt_rad.x(), observation.pan_tilt_rad.y()); }));
  all.push_back(misreading_of(
      head, "u and v" + of + " exchanged", "exchange u_px and v_px (row and column): then the events fit the rig",
      [](TargetObservation& observation) { std::swap(observation.px.x(), observation.px.y()); }));
}

void add_turned(std::span<const RigHead> heads, std::optional<std::size_t> head, std::vector<TableMisreading>& all) {
  add_signs(heads, head, all);
  add_mirrors(heads, head, all);
}

std::vector<TableMisreading> misreadings(const Observations& given, std::span<const RigHead> heads,
                                         const FollowConfig& config, bool fits) {
  std::vector<TableMisreading> all = misread_units(given, heads, config.tracker.together_s, fits);
  const std::size_t num = std::min<std::size_t>(heads.size(), 4);
  for (std::size_t a = 0; a < num; ++a)
    for (std::size_t b = a + 1; b < num; ++b)
      all.push_back({{num == 2 ? "heads swapped" : head_name(heads, a) + " and " + head_name(heads, b) + " swapped",
                      "exchange the two heads' names in the events or in the rig: then they fit"},
                     [a, b](TargetObservation& observation) {
                       observation.head = observation.head == a ? b : observation.head == b ? a : observation.head;
                     }});
  add_turned(heads, std::nullopt, all);
  add_exchanges(heads, std::nullopt, all);
  for (std::size_t head = 0; head < num; ++head) {
    add_turned(heads, head, all);
    add_exchanges(heads, head, all);
  }
  return all;
}

/// Of three or more heads, the one without which the observations of the others fit.
std::optional<Explanation> foreign_head(const Observations& observations, std::span<const RigHead> heads,
                                        const FollowConfig& config) {
  std::optional<Explanation> found;
  for (std::size_t head = 0; heads.size() > 2 && head < heads.size(); ++head) {
    Observations others = observations;
    std::erase_if(others, [&](const TargetObservation& observation) { return observation.head == head; });
    if (others.size() == observations.size() || !tried(others, heads, config).fits) continue;
    if (found) return std::nullopt;  // if two heads qualify, neither is named
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

namespace {

constexpr double clear = 15.0;  // in ln p: never by chance alone

/// The first observations (up to a limit) in order of capture.
Observations some_of(std::span<const TargetObservation> observations, std::span<const RigHead> heads) {
  constexpr std::size_t max_observations = 1200;
  Observations some = with_shift(observations.first(std::min(observations.size(), max_observations)), {});
  std::erase_if(some, [&](const TargetObservation& observation) { return observation.head >= heads.size(); });
  return some;
}

struct Likelier {
  double ln_p = 0.0;
  Explanation explanation;
  Observations observations;  ///< With the misreading undone.
};

/// The misreading without which the observations fit with a far higher likelihood; two if nearly equally likely.
std::optional<Likelier> likeliest(const Observations& given, std::span<const RigHead> heads, const FollowConfig& config,
                                  std::span<const TableMisreading> all) {
  constexpr std::size_t first_observations = 160;
  constexpr double min_gain = 30.0, of_gain = 0.03;  // no motion model is more accurate
  const double as_given = tried(given, heads, config).ln_p;
  std::vector<Likelier> fitting;
  for (const TableMisreading& misreading : all) {
    Observations changed = given;
    for (TargetObservation& observation : changed) misreading.undo(observation);
    changed = with_shift(changed, {});
    // A misreading that does not fit the first observations does not fit all of them.
    const Observations some(
        changed.begin(), changed.begin() + static_cast<std::ptrdiff_t>(std::min(changed.size(), first_observations)));
    if (changed.size() > 2 * first_observations && !tried(some, heads, config).fits) continue;
    const Trial trial = tried(changed, heads, config);
    if (trial.fits && trial.ln_p > as_given + min_gain)
      fitting.push_back({trial.ln_p, misreading.explanation, std::move(changed)});
  }
  if (fitting.empty()) return std::nullopt;
  std::ranges::stable_sort(fitting, std::ranges::greater{}, &Likelier::ln_p);
  Likelier best = fitting.front();
  const double near = std::max(clear, of_gain * (best.ln_p - as_given));
  if (fitting.size() > 1 && fitting[1].ln_p > best.ln_p - near)
    best.explanation = {best.explanation.what + ", or " + fitting[1].explanation.what,
                        best.explanation.to_do + "; or " + fitting[1].explanation.to_do +
                            "; each gives another path: look which of them is so"};
  return best;
}

/// ln p for the given motion of the target or for one that may fall, whichever is larger.
double ln_p_of(const Observations& observations, std::span<const RigHead> heads, FollowConfig config) {
  const double as_said = tried(observations, heads, config).ln_p;
  config.tracker.method = TargetMotion::imm;
  return std::max(as_said, tried(observations, heads, config).ln_p);
}

/// ln p of the observations under the likeliest of the other explanations.
double ln_p_of_rivals(const Observations& given, std::span<const RigHead> heads, const FollowConfig& config,
                      std::span<const RigFault> faults) {
  double most = ln_p_of(given, heads, config);
  for (const RigFault& fault : faults) {
    const WithoutFault right = without_fault(given, heads, fault);
    most = std::max(most, ln_p_of(with_shift(right.observations, {}), right.heads, config));
  }
  if (const auto shift = probable_clock_shift(given, heads, config))
    most = std::max(most, ln_p_of(with_shift(given, *shift), heads, config));
  return most;
}

}  // namespace

std::optional<Explanation> misread_table(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads, const FollowConfig& config,
                                         std::span<const RigFault> faults) {
  std::vector<TableMisreading> mirrors;
  add_turned(heads, std::nullopt, mirrors);  // for heads side by side, a tilt that counts downwards acts like a flip
  for (std::size_t head = 0; head < std::min<std::size_t>(heads.size(), 4); ++head) add_mirrors(heads, head, mirrors);
  const Observations given = some_of(observations, heads);
  std::optional<double> rivals;
  for (const std::vector<TableMisreading>& tried_now : {mirrors, misreadings(given, heads, config, /*fits=*/true)}) {
    auto best = likeliest(given, heads, config, tried_now);
    if (!best) continue;
    if (!rivals) rivals = ln_p_of_rivals(given, heads, config, faults);
    if (ln_p_of(best->observations, heads, config) > *rivals + clear) return std::move(best->explanation);
  }
  return std::nullopt;
}

std::optional<Explanation> explanation_of(std::span<const TargetObservation> observations,
                                          std::span<const RigHead> heads, const FollowConfig& config, bool fits) {
  const Observations given = some_of(observations, heads);
  if (auto best = likeliest(given, heads, config, misreadings(given, heads, config, fits)))
    return std::move(best->explanation);
  return foreign_head(given, heads, config);
}

namespace {

/// Number of simultaneous pairs of observations, and of those with parallel rays.
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

namespace {

constexpr double good_share = 0.95;  // of the observations are used

double ln_p(const TrackReport& report, double gate) {
  return report.log_likelihood - gate * static_cast<double>(report.num_restarts);  // a restart hides its misfit
}

}  // namespace

std::optional<Check> falling_target(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                    const FollowConfig& config) {
  constexpr std::size_t max_observations = 1200;
  constexpr double min_gain = 20.0;
  const TargetMotion method = config.tracker.method;
  if (method == TargetMotion::imm) return std::nullopt;
  FollowConfig plain = config;
  plain.judge = false;
  const Observations some = with_shift(observations.first(std::min(observations.size(), max_observations)), {});
  const double as_given = ln_p(track_target(some, heads, plain), config.tracker.gate);
  plain.tracker.method = TargetMotion::imm;
  const TrackReport falls = track_target(some, heads, plain);
  // If the noise is larger than stated, so is every log-likelihood: divided by the remaining NIS (QAIC).
  const double gain = (ln_p(falls, config.tracker.gate) - as_given) / std::max(1.0, falls.nis_per_dof);
  // It must also let the observations fit: clutter is rejected by both models.
  if (falls.num_starts == 0 || !(gain > min_gain) ||
      static_cast<double>(falls.num_used) < good_share * static_cast<double>(some.size()))
    return std::nullopt;
  const std::string what = method == TargetMotion::ballistic
                               ? "the target does not fall freely all the time, as one that bounces or is moved"
                               : "the target moves as one that falls, or that is quiet and agile in turn";
  return Check{"falls", State::care, what + ": --method imm (ln of the ratio " + text_of(gain, 2) + ")", gain, min_gain,
               "1",     "track"};
}

}  // namespace alidade
