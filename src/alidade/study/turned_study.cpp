#include <cmath>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/turned_scene.h"
#include "alidade/study/studies.h"
#include "alidade/study/trial_random.h"
#include "alidade/turned/turned.h"

namespace alidade {
namespace {

/// A camera of 35 to 75° across, 5 to 14 photos, overlaps of a half to three quarters.
TurnedScene any_scene(std::uint64_t seed) {
  Draws draws(seed);
  TurnedScene scene;
  scene.fx = scene.fy = draws.uniform(850.0, 2000.0);
  scene.cx = 639.5 + 12.0 * draws.normal();
  scene.cy = 479.5 + 12.0 * draws.normal();
  scene.k1 = 0.1 * draws.uniform(-1.0, 1.0) * std::pow(scene.fx / 1000.0, 2);
  scene.num_photos = 5 + static_cast<int>(10.0 * draws.uniform());
  scene.pan_step_rad = draws.uniform(0.25, 0.5) * scene.width_px / scene.fx;
  scene.tilt_rad = draws.uniform(0.0, 0.3) * scene.height_px / scene.fx;
  scene.points_per_rad2 = 250.0 * std::pow(scene.fx / 1000.0, 2);
  scene.sigma_px = draws.uniform(0.2, 1.0);
  return scene;
}

TurnedScene scene_of(const TurnedStudy& study, std::uint64_t seed) {
  TurnedScene scene = any_scene(seed);
  scene.wrong_share = study.wrong_matches;
  scene.moving_share = study.moving_points;
  scene.lever_m.z() = study.lever_m;
  scene.sigma_step_m = study.step_m;
  if (study.focus > 0.0)
    for (int k = 0; k < scene.num_photos; ++k) scene.zoom.push_back(1.0 + study.focus * std::sin(2.0 * k));
  return scene;
}

}  // namespace

FieldList fields_of(TurnedStudy& study) {
  return {
      {.name = "wrong_matches",
       .value = &study.wrong_matches,
       .help = "Share of the matches with a random other point",
       .limits = {0.0, 0.9}},
      {.name = "moving_points",
       .value = &study.moving_points,
       .help = "Share of the points that move between photos",
       .limits = {0.0, 0.9}},
      {.name = "lever_m",
       .value = &study.lever_m,
       .help =
           "Offset of the camera centre from the centre of rotation, along the optical axis [m]; points at 2 to 20 m",
       .limits = {-1.0, 1.0}},
      {.name = "step_m",
       .value = &study.step_m,
       .help = "σ of the movement of the hand from photo to photo [m]",
       .limits = {0.0, 1.0}},
      {.name = "focus",
       .value = &study.focus,
       .help = "Relative variation of the focal length from photo to photo",
       .limits = {0.0, 0.1}},
      {.name = "on_the_spot", .value = &study.on_the_spot, .help = "Camera centre given as fixed: --sigma-parallax 0"}};
}

TurnedTrial trial_of(const TurnedStudy& study, std::uint64_t seed, std::uint64_t number) {
  const std::uint64_t own = TrialRandom(seed, TurnedStudy::name, number).seed();
  const TurnedScene scene = scene_of(study, own);
  TurnedTrial trial{simulate_turned_photos(scene, own), {}, {scene.fx, scene.fy, scene.cx, scene.cy}};
  if (study.on_the_spot) trial.config.sigma_parallax = 0.0;
  return trial;
}

StudySetting setting_of(const TurnedStudy& study, std::uint64_t seed) {
  const RunTrial run = [=](std::uint64_t number, TrialResult& result) {
    TurnedTrial trial = trial_of(study, seed, number);
    const ObserveReport report = observe_matched(std::move(trial.photos), trial.config);
    result.state = report.verdict.state;
    if (report.quantities.size() < 4) return;
    result.has_estimate = true;
    for (std::size_t i = 0; i < 4; ++i) {
      // Focal lengths differ from trial to trial: their errors are relative.
      const double truth = trial.truth[static_cast<Eigen::Index>(i)], unit = i < 2 ? truth : 1.0;
      const double sigma = report.quantities[i].sigma / unit;
      result.values.push_back({(report.quantities[i].value - truth) / unit, sigma, sigma});
    }
  };
  return {{{"fx", "1"}, {"fy", "1"}, {"cx", "px"}, {"cy", "px"}}, false, [run] { return run; }};
}

}  // namespace alidade
