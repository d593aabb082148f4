#pragma once

#include <optional>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/beam/shot.h"

namespace alidade {

/// A shot made ready for the solver: every σ known, the board's plane known, and only what the method uses.
struct PreparedShot {
  std::size_t index = 0;  ///< In the caller's list.
  double range_m = 0.0;
  std::optional<double> sigma_range_m;  ///< Of this reading alone; else the common noise.
  std::optional<Eigen::Vector2d> spot_px;
  std::optional<Eigen::Vector3d> spot_ray;  ///< Unit ray of the spot, in the camera frame.
  double sigma_spot_px = 1.0;
  bool owns_spot_sigma = false;      ///< The shot brought its σ.
  double min_sigma_spot_px = 0.0;    ///< What its finder knows of.
  std::optional<Plane> plane;        ///< The board's; is compared with the reading.
  std::optional<BoardPose> pose;     ///< Where the plane comes from a board; else the plane's own covariance counts.
  const BoardView* board = nullptr;  ///< Its corners, where it has them.
  double corner_factor = 1.0;  ///< On the corners' σ, as this board's fit shows: a near one shows that it is curved.
  Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_lens;  ///< How the pose follows the lens; empty where it does not.
  bool used = true;  ///< Of the laser: false for an outlier (its corners still determine the lens).

  [[nodiscard]] int num_rows() const { return (plane ? 1 : 0) + (spot_px ? 2 : 0); }
};

/// What the residuals of a shot depend on beside the shot: the reading counted once or twice, and the common noise.
struct ShotModel {
  RangeNoise noise;
  bool reading_counts_twice = false;
};

/// Residuals (prediction − observation) of one shot: the reading [m] where there is a plane, then the spot [px] where
/// there is one; with their derivatives and the covariance of what they were measured with. With a plane, the spot is
/// predicted where the beam meets it, so that each measurement is in one residual; without, at the reading, whose error
/// then moves the spot along the beam's image.
struct ShotResidual {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;
  Rows r;
  Eigen::Matrix<double, Eigen::Dynamic, num_beam_params, 0, 3, num_beam_params> J_beam;
  Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_pose;   ///< By ξ of the pose; zero without a pose.
  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, 3, 4> J_plane;  ///< By (normal, d) of the plane.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 16> J_lens;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3> J_errors;  ///< By an error of the reading [m], of the spot [px].
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> noise_cov;  ///< Without the plane's.
};

/// None where the beam does not meet the plane ahead, or the lens does not see the spot: a step to there is refused.
[[nodiscard]] std::optional<ShotResidual> shot_residual(const PreparedShot& shot, const Beam& beam,
                                                        const Camera& camera, const ShotModel& model);

/// Its covariance with that of the plane (pose) carried into it.
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> full_covariance(
    const PreparedShot& shot, const ShotResidual& residual);

/// Lower-triangular L⁻¹ of cov = L Lᵀ: makes residuals white.
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> whitener_of(
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& cov);

}  // namespace alidade
