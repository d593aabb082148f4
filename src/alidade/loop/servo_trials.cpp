#include <algorithm>
#include <utility>

#include "alidade/loop/servo_study.h"

namespace alidade {
namespace {

std::vector<double> evenly(double low, double high, int points) {
  std::vector<double> values;
  for (int i = 0; i < points; ++i) values.push_back(points > 1 ? low + (high - low) * i / (points - 1) : low);
  return values;
}

std::vector<LensComparison> compare_lenses(const ServoScenario& scenario, const ServoStudy& study,
                                           std::uint64_t first_seed, const Progress& progress) {
  std::vector<LensComparison> lenses;
  if (scenario.scene.zoom.is_still() && scenario.scene.intrinsics == LensKnowledge::given) return lenses;
  ServoConfig config = scenario.config;
  config.controller = study.best;
  const auto num_seeds = static_cast<std::size_t>(scenario.num_seeds);
  for (const LensKnowledge knowledge : {LensKnowledge::given, LensKnowledge::observed, LensKnowledge::truth}) {
    LensComparison compared{knowledge, {}, {}};
    ServoScene scene = scenario.scene;
    scene.intrinsics = knowledge;
    for (std::size_t i = 0; i < num_seeds; ++i) {
      report_progress(progress, "lenses", lenses.size() * num_seeds + i, 3 * num_seeds);
      compared.trials.push_back(run_servo(scene, config, first_seed + i).figures);
    }
    compared.figures = put_together(compared.trials);
    lenses.push_back(std::move(compared));
  }
  return lenses;
}

}  // namespace

ServoStudy study_servo(const ServoScenario& scenario, std::uint64_t first_seed, const Progress& progress,
                       const ServoWatch& watch) {
  ServoStudy study;
  study.loops = check_loops(scenario);
  if (!std::ranges::all_of(study.loops, &LoopCheck::is_stable)) return study;
  study.status = ServoStudy::Status::compared;
  const auto num_seeds = static_cast<std::size_t>(scenario.num_seeds);
  ServoConfig config = scenario.config;
  for (const ControllerKind kind : scenario.controllers) {
    config.controller = kind;
    ServoComparison compared{kind, {}, {}};
    std::vector<ServoFigures> figures;
    std::function<void(const ServoRow&)> watch_first;
    if (watch) watch_first = [&](const ServoRow& row) { watch(kind, row); };
    for (std::size_t i = 0; i < num_seeds; ++i) {
      report_progress(progress, "trials", study.trials.size(), num_seeds * scenario.controllers.size());
      ServoRun run = run_servo(scenario.scene, config, first_seed + i, i == 0 ? watch_first : nullptr);
      figures.push_back(run.figures);
      study.trials.push_back({kind, first_seed + i, run.figures});
      if (i == 0) compared.shown = std::move(run);
    }
    compared.figures = put_together(figures);
    study.comparison.push_back(std::move(compared));
  }
  study.best = std::ranges::min_element(study.comparison, {}, [](const ServoComparison& c) {
                 return c.figures.rms_px;
               })->controller;
  study.lenses = compare_lenses(scenario, study, first_seed, progress);
  if (scenario.scene.heads.size() > 1) {
    const auto best = std::ranges::find(study.comparison, study.best, &ServoComparison::controller);
    study.track = track_of(scenario.scene, best->shown);
  }
  if (scenario.robustness) {
    const RobustnessConfig& grid = *scenario.robustness;
    config.controller = study.best;
    study.robustness = servo_robustness(scenario.scene, config, evenly(grid.gain_low, grid.gain_high, grid.points),
                                        evenly(grid.tau_low, grid.tau_high, grid.points), first_seed, progress);
  }
  return study;
}

}  // namespace alidade
