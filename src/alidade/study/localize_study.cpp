#include <cmath>

#include "alidade/reproduce/underwater_protocol.h"
#include "alidade/study/studies.h"
#include "alidade/study/trial_random.h"

namespace alidade {

FieldList fields_of(LocalizeStudy& study) {
  return {
      {.name = "points",
       .value = &study.points,
       .help = "Number of points: the board's 8, four of them known, then others",
       .limits = {8, 200}},
      {.name = "frames", .value = &study.frames, .help = "Number of frames, at 10 Hz", .limits = {3, 10000}},
      {.name = "noise_px", .value = &study.noise_px, .help = "σ of a pixel coordinate [px]", .limits = {1e-6, 100.0}},
      {.name = "depth_sigma",
       .value = &study.depth_sigma,
       .help = "Relative σ of the initial depth of an unknown point",
       .limits = {1e-6, 1.0}}};
}

LocalizeTrial trial_of(const LocalizeStudy& study, std::uint64_t seed, std::uint64_t number) {
  UnderwaterScene scene;
  scene.camera = underwater_camera();
  scene.num_points = study.points;
  scene.num_frames = study.frames;
  scene.sigma_px = study.noise_px;
  scene.sigma_depth = study.depth_sigma;
  auto sample = reproduce::underwater_sample(scene, TrialRandom(seed, LocalizeStudy::name, number).seed());
  sample.config.sigma_px = study.noise_px;
  return {std::move(sample.frames), sample.camera, std::move(sample.config), std::move(sample.truth)};
}

StudySetting setting_of(const LocalizeStudy& study, std::uint64_t seed) {
  const RunTrial run = [=](std::uint64_t number, TrialResult& result) {
    const LocalizeTrial trial = trial_of(study, seed, number);
    const Localization report = localize(trial.frames, trial.camera, trial.config);
    result.state = report.verdict.state;
    if (report.path.empty() || !report.path.back().has_pose()) return;
    const PathStep& last = report.path.back();
    const Eigen::Vector3d error =
        last.world_from_cam.translation - trial.truth[report.path.size() - 1].world_from_cam.translation;
    // Of the right perturbation: in the camera's axes.
    const Eigen::Matrix3d world_from_cam = last.world_from_cam.rotation.toRotationMatrix();
    const Eigen::Matrix3d cov = world_from_cam * last.cov.topLeftCorner<3, 3>() * world_from_cam.transpose();
    result.has_estimate = true;
    for (int i = 0; i < 3; ++i) {
      const double sigma = std::sqrt(cov(i, i));
      result.values.push_back({error[i], sigma, sigma});
    }
  };
  return {{{"x_m", "m"}, {"y_m", "m"}, {"z_m", "m"}}, false, [run] { return run; }};
}

}  // namespace alidade
