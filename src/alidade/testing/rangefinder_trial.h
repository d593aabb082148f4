#pragma once

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/testing/rangefinder_sample.h"

// One calibration of a simulated rangefinder that is not as its user believes: what the verdict says, and how far off
// it is.

namespace alidade::testing {

struct RangefinderTrialSetup {
  std::string scenario = "reference";
  double scale = 1.0;   ///< Metres for each metre read.
  double square = 0.0;  ///< Share by which the board is printed larger than given.
  ShotNoise noise = {};
  ShotMistake mistake = {};
  RangefinderMethod method = RangefinderMethod::joint;
  int num_shots = 18;
  bool gives_lengths = false;  ///< The user takes the readings' scale and the squares for exact.
  bool asks_scale = false;     ///< The user takes the squares for exact and estimates the readings' scale.
  std::optional<double> sigma_range_m = {}, sigma_flat_m = {};  ///< Told by the user.
  bool has_boards = true;                                       ///< Else spots alone are left.
  bool is_mirrored = false;                                     ///< The images are, left to right.
};

/// The shots as their mirrored images show them.
inline void mirror(std::vector<Shot>& shots, int width_px) {
  const auto mirrored = [&](double u) { return width_px - 1 - u; };
  for (Shot& shot : shots) {
    if (shot.spot) shot.spot->px.x() = mirrored(shot.spot->px.x());
    if (!shot.board) continue;
    for (Corner& corner : shot.board->corners) corner.px.x() = mirrored(corner.px.x());
  }
}

struct RangefinderTrial {
  SolvedRangefinder solved;
  double worst_sigmas = 0.0;  ///< Largest error of origin and direction, in its stated σ.
  bool is_seen = false;       ///< Refused, doubted, or estimated.

  [[nodiscard]] bool is_silent() const { return solved.verdict.state == State::good && !(worst_sigmas <= 5.0); }
};

inline RangefinderTrial rangefinder_trial(const RangefinderTrialSetup& setup, std::uint64_t seed) {
  RangefinderSceneConfig config = *rangefinder_scenario(setup.scenario);
  config.beam.scale = setup.scale;
  config.num_shots = setup.num_shots;
  config.board.square_m *= 1.0 + setup.square;
  RangefinderSample sample = draw_rangefinder_sample(config, setup.noise, seed);
  for (Eigen::Vector3d& point : sample.points) point /= 1.0 + setup.square;
  std::vector<Shot> shots = mistaken_shots(sample.simulated.shots, setup.mistake);
  if (!setup.has_boards)
    for (Shot& shot : shots) shot.board.reset();
  if (setup.is_mirrored) mirror(shots, sample.camera.width_px);
  const Camera camera = mistaken_camera(sample.camera, setup.mistake);
  RangefinderConfig given{.method = setup.method};
  given.sigma_range_m = setup.sigma_range_m;
  given.sigma_flat_m = setup.sigma_flat_m;
  if (setup.gives_lengths) given.sigma_scale = given.sigma_square_m = 0.0;
  if (setup.asks_scale) {
    given.estimate_scale = true;
    given.sigma_square_m = 0.0;
  }
  RangefinderTrial trial{solve_rangefinder(shots, sample.points, camera, given)};
  Verdict& verdict = trial.solved.verdict;
  const RangefinderReport& report = trial.solved.report;
  const bool is_solved = verdict.state == State::good || verdict.state == State::care;
  if (is_solved) heed_assumptions(rangefinder_assumptions(report), verdict);
  trial.is_seen = verdict.state != State::good;
  if (!is_solved) return trial;
  // A constant in the readings is part of the origin: the beam that reads so starts so much farther back.
  const Beam& truth = sample.scene.beam;
  const Eigen::Vector3d origin = truth.origin_in_cam - truth.scale * setup.mistake.offset_m * truth.direction_in_cam;
  Eigen::Matrix<double, 5, 1> error;
  error << report.beam.origin_in_cam - origin, direction_error_rad(report, sample);
  for (int i = 0; i < 5; ++i)
    trial.worst_sigmas = std::max(trial.worst_sigmas, std::abs(error[i]) / std::sqrt(report.beam.cov(i, i)));
  return trial;
}

}  // namespace alidade::testing
