#pragma once

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/rig/rig.h"
#include "alidade/simulate/rangefinder.h"
#include "alidade/simulate/rig.h"

// One calibration of a simulated rig that is not as its user believes: what the verdict says, and how far off it is.

namespace alidade::testing {

struct RigTrialSetup {
  RigSceneConfig scene = {};
  RigNoise noise = {};
  RigMistake mistake = {};
  bool by_need = true;
  bool gives_scale = true;    ///< The user takes the encoders' scales for exact.
  double sigma_scale = 1e-9;  ///< Or known to so much.
  double sigma_lens_px =
      0.0;  ///< That the files state of focal lengths and centres, which are exact but for the mistake.
  bool first_lens_only = false;  ///< Only its file is mistaken.
};

struct RigTrial {
  RigReport report;
  Verdict verdict;
  double worst_sigmas = 0.0;  ///< Largest error of where the cameras are, in its stated σ.
  bool is_seen = false;       ///< Refused, doubted, or estimated.

  [[nodiscard]] bool is_silent() const { return verdict.state == State::good && !(worst_sigmas <= 5.0); }
};

/// Of the second camera (of one head: of itself at other angles) in the first, over pairs of angles.
inline double worst_error_in_sigmas(const Rig& rig, const Rig& truth) {
  double worst = 0.0;
  const std::size_t second = rig.heads.size() - 1;
  for (const double side : {-1.0, 0.5, 1.0}) {
    const Eigen::Vector2d a(0.3 * side, 0.2), b(-0.4 * side, 0.1);
    const auto between = [&](const Rig& of) {
      return cam_from_world(of.heads[0].head, a) * world_from_cam(of.heads[second].head, b);
    };
    const Rigid3 found = between(rig), expected = between(truth);
    Eigen::Matrix<double, 6, 1> xi;
    xi << expected.rotation.conjugate() * (found.translation - expected.translation),
        log_so3(expected.rotation.conjugate() * found.rotation);
    const auto stated = relative_covariance(rig, 0, a, second, b);
    for (int k = 0; k < 6; ++k) worst = std::max(worst, std::abs(xi[k]) / std::sqrt(stated(k, k)));
  }
  return worst;
}

inline RigTrial rig_trial(const RigTrialSetup& setup, std::uint64_t seed) {
  const RigScene scene = draw_rig_scene(setup.scene, seed);
  std::map<int, Camera> cameras;
  for (const RigHead& rig_head : scene.rig.heads) {
    const bool is_mistaken = !setup.first_lens_only || cameras.empty();
    Camera& camera = cameras[rig_head.head.id] =
        is_mistaken
            ? mistaken_camera(rig_head.camera, {.focal = setup.mistake.focal, .centre_px = setup.mistake.centre_px})
            : rig_head.camera;
    const Eigen::Index num = params(camera.lens).size();
    camera.cov.setZero(num, num);  // its file says that it is exact
    camera.cov.diagonal().head<4>().setConstant(setup.sigma_lens_px * setup.sigma_lens_px);
  }
  const std::vector<HeadView> views =
      mistaken_views(simulate_head_views(scene, setup.noise, seed).views, scene, setup.mistake);
  RigConfig config;
  config.board = scene.board;
  config.sigma_square_m = 1e-9;
  if (setup.gives_scale) config.sigma_scale = setup.sigma_scale;
  RigTrial trial;
  const auto calibrated = setup.by_need ? calibrate_rig_by_need : calibrate_rig;
  trial.report = calibrated(views, points_in_board(scene.board), cameras, config, {});
  trial.verdict = rig_verdict(trial.report, config);
  const bool is_solved = trial.verdict.state == State::good || trial.verdict.state == State::care;
  Rig truth = scene.rig;
  if (setup.mistake.flip_pan)
    for (RigHead& one : truth.heads) one.head.encoder.pan_scale *= -1.0;
  if (is_solved) trial.worst_sigmas = worst_error_in_sigmas(trial.report.rig, truth);
  trial.is_seen = trial.verdict.state != State::good ||
                  std::ranges::any_of(trial.report.freed, [](const RigFreed& one) { return one.sigmas() > 3.0; });
  return trial;
}

}  // namespace alidade::testing
