#pragma once

#include <cstdint>
#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/loop/servo_track.h"

namespace alidade {

/// Factors on gain and time constant, evenly from low to high.
struct RobustnessConfig {
  double gain_low = 0.8, gain_high = 1.2;
  double tau_low = 0.7, tau_high = 1.3;
  int points = 5;  ///< Of each.
};

/// What `alidade servo` reads: a world, and which controllers are to be compared in it. The defaults are the preset of
/// docs/maths/servo.md: plant, gains, rig and target of Xiahou, Chen & Wu, 2015.
struct ServoScenario {
  ServoScene scene = xiahou_servo_scene();
  ServoConfig config;
  std::vector<ControllerKind> controllers{controller_kinds.begin(), controller_kinds.end()};
  int num_seeds = 8;
  double specification_px = 10.0;  ///< RMS that is asked for: lines in figures, and the verdict's.
  std::optional<RobustnessConfig> robustness = RobustnessConfig{};
};

/// The linear loop that a controller closes, before anything moves.
struct LoopCheck {
  ControllerKind controller;
  LoopAnalysis analysis;
  double loop_gain = 0.0;  ///< Error units of the gains per unit of the plant's output.
  int delay_samples = 0;   ///< −1: the controller was tried, and `sampled_radius` alone is told.
};
/// Of `pi`, round plant and image; of `feedforward`, the correction round plant and encoder; of all others, of
/// `feedforward` on a rate plant, and where a command is a part of a period late or the plant has a second lag, what
/// the controller itself does to a small offset. Each with plant and delays as they are.
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
  std::vector<ServoFigures> trials;  ///< One a seed.
  ServoFigures figures;              ///< Of all of them.
};

struct ServoStudy {
  std::vector<LoopCheck> loops;
  std::vector<ServoTrial> trials;
  std::vector<ServoComparison> comparison;  ///< In the order of the scenario; empty where a loop is unstable.
  ControllerKind best = ControllerKind::pi;
  ServoTrack track;                           ///< Of the best one's shown run; two heads or more.
  std::optional<ServoRobustness> robustness;  ///< Of the best.
  std::vector<LensComparison> lenses;         ///< Where the lens zooms, or an observer tells of it; else none.
};

/// Is shown the rows of each controller's first trial as they come.
using ServoWatch = std::function<void(ControllerKind, const ServoRow&)>;

/// Every controller over the same seeds. Nothing runs where check_loops finds an unstable loop.
[[nodiscard]] ServoStudy study_servo(const ServoScenario& scenario, std::uint64_t first_seed,
                                     const Progress& progress = {}, const ServoWatch& watch = {});

[[nodiscard]] Verdict servo_verdict(const ServoScenario& scenario, const ServoStudy& study);

}  // namespace alidade
