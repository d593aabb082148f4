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

/// The linear loop that a controller closes, before anything moves.
struct LoopCheck {
  ControllerKind controller;
  LoopAnalysis analysis;
  double loop_gain = 0.0;  ///< Error units of the gains per unit of the plant's output.
  int delay_samples = 0;   ///< In whole periods; −1: the controller was tried, and `sampled_radius` alone is known.
  /// RMS about a target at rest, the lens at its longest, where the loop keeps to a shorter one; 0: not tried.
  double rest_px = 0.0;
  /// RMS about its mean that is left long after the target has jumped by a quarter of the image and rests, where limits
  /// of rate and acceleration, dead band or backlash keep the loop from rest; 0: it comes to rest, or is linear.
  double swing_px = 0.0;
  double free_px = 0.0;        ///< The same without them.
  std::string swings_by = {};  ///< Without which alone it rests, or all of them; empty: it rests.
  std::size_t head = 0;        ///< Of whose lens it is the loop: the one nearest to instability.
  std::size_t axis = 0;        ///< Of which axis: 0 pan, 1 tilt.
  /// Largest |eigenvalue| where gain, time constant and delay of the plant are off by 3σ, each either way; 0: no σ.
  double radius_within_sigma = 0.0;

  [[nodiscard]] bool is_stable() const;
  [[nodiscard]] bool swings() const { return swing_px > 0.0; }
};
/// Of `pi`, round plant and image; of `feedforward` on an angle plant, the correction round plant and encoder; of all
/// others what the controller itself does to a small offset. Each with plant, lags and delays as they are. What
/// predicts the target from pixels that it takes by another lens is tried on a target at rest, too. Of several heads
/// and of both axes the one nearest to instability.
[[nodiscard]] std::vector<LoopCheck> check_loops(const ServoScenario& scenario);

struct ServoTrial {
  ControllerKind controller;
  std::uint64_t seed = 0;
  ServoFigures figures;
};

struct ServoComparison {
  ControllerKind controller;
  ServoFigures figures;  ///< Of all its trials.
  ServoRun shown;        ///< Its first trial, row by row.
};

/// The best controller with each kind of knowledge of a lens that zooms, over the same seeds.
struct LensComparison {
  LensKnowledge knowledge;
  std::vector<ServoFigures> trials;  ///< One per seed.
  ServoFigures figures;              ///< Of all of them.
};

struct ServoStudy {
  enum class Status { compared, unstable };
  Status status = Status::unstable;
  std::vector<LoopCheck> loops;
  std::vector<ServoTrial> trials;
  std::vector<ServoComparison> comparison;  ///< In the order of the scenario; empty where a loop is unstable.
  ControllerKind best = ControllerKind::pi;
  ServoTrack track;                           ///< Of the best one's shown run; two heads or more.
  std::optional<ServoRobustness> robustness;  ///< Of the best.
  std::vector<LensComparison> lenses;         ///< Where the lens zooms, or an observer estimates it; else none.
};

/// Called with the rows of each controller's first trial.
using ServoWatch = std::function<void(ControllerKind, const ServoRow&)>;

/// Every controller over the same seeds. Nothing runs where check_loops finds an unstable loop.
[[nodiscard]] ServoStudy study_servo(const ServoScenario& scenario, std::uint64_t first_seed,
                                     const Progress& progress = {}, const ServoWatch& watch = {});

[[nodiscard]] Verdict servo_verdict(const ServoScenario& scenario, const ServoStudy& study);

/// The result of servo(): figures of the controllers, and the verdict.
struct ServoResult : ServoStudy {
  ServoScenario scenario;
  std::uint64_t seed = 1;  ///< Of the first run.
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of trials.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
