#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/loop/servo_scenario.h"
#include "alidade/loop/servo_track.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Linear analysis of the loop that a controller closes, done before the simulation.
struct LoopCheck {
  ControllerKind controller;
  LoopAnalysis analysis;
  double loop_gain = 0.0;  ///< Error units of the gains per unit of the plant's output.
  int delay_samples = 0;   ///< In whole periods; −1: the loop was simulated, and only `sampled_radius` is known.
  /// RMS for a target at rest, at the longest focal length, if the loop assumes a shorter one; 0: not simulated.
  double rest_px = 0.0;
  /// RMS about its mean that remains long after the target has jumped by a quarter of the image and rests, if limits of
  /// rate and acceleration, dead band or backlash keep the loop from settling; 0: it settles, or is linear.
  double swing_px = 0.0;
  double free_px = 0.0;        ///< The same without these nonlinearities.
  std::string swings_by = {};  ///< The one without which it settles, or all of them; empty: it settles.
  std::size_t head = 0;        ///< Its lens determines the loop: the head nearest to instability.
  std::size_t axis = 0;        ///< Likewise the axis: 0 pan, 1 tilt.
  /// Spectral radius if gain, time constant and delay of the plant are off by 3σ, worst combination; 0: no σ given.
  double radius_within_sigma = 0.0;

  [[nodiscard]] bool is_stable() const;
  [[nodiscard]] bool swings() const { return swing_px > 0.0; }
};
/// `pi`: the loop through plant and image; `feedforward` on an angle plant: the correction through plant and encoder;
/// otherwise the response of the controller itself to a small offset. Each with the true plant, lags and delays. If it
/// predicts the target from pixels with a wrong lens, it is also simulated with a target at rest. Of several heads and
/// of both axes, the one nearest to instability is reported.
[[nodiscard]] std::vector<LoopCheck> check_loops(const ServoScenario& scenario);

struct ServoTrial {
  ControllerKind controller;
  std::uint64_t seed = 0;
  ServoFigures figures;
};

struct ServoComparison {
  ControllerKind controller;
  ServoFigures figures;  ///< Over all its trials.
  ServoRun shown;        ///< Its first trial, row by row.
};

/// The best controller with each kind of knowledge of a zooming lens, with the same seeds.
struct LensComparison {
  LensKnowledge knowledge;
  std::vector<ServoFigures> trials;  ///< One per seed.
  ServoFigures figures;              ///< Over all trials.
};

struct ServoStudy {
  enum class Status { compared, unstable };
  Status status = Status::unstable;
  std::vector<LoopCheck> loops;
  std::vector<ServoTrial> trials;
  std::vector<ServoComparison> comparison;  ///< In the order of the scenario; empty if a loop is unstable.
  ControllerKind best = ControllerKind::pi;
  ServoTrack track;                           ///< From the shown run of the best controller; two heads or more.
  std::optional<ServoRobustness> robustness;  ///< Of the best controller.
  std::vector<LensComparison> lenses;         ///< If the lens zooms, or an observer estimates it; else empty.
};

/// Called with the rows of each controller's first trial.
using ServoWatch = std::function<void(ControllerKind, const ServoRow&)>;

/// Runs every controller with the same seeds. Nothing is run if check_loops() finds an unstable loop.
[[nodiscard]] ServoStudy study_servo(const ServoScenario& scenario, std::uint64_t first_seed,
                                     const Progress& progress = {}, const ServoWatch& watch = {});

[[nodiscard]] Verdict servo_verdict(const ServoScenario& scenario, const ServoStudy& study);

/// The result of servo(): figures of merit of the controllers, and the verdict.
struct ServoResult : ServoStudy {
  ServoScenario scenario;
  std::uint64_t seed = 1;  ///< Seed of the first run.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Number of trials.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
