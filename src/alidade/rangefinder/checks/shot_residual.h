#pragma once

#include <optional>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/beam/shot.h"

namespace alidade {

/// A shot prepared for the solver: every σ and the plane of the board known, and only the data that the method uses.
struct PreparedShot {
  std::size_t index = 0;  ///< In the caller's list.
  double range_m = 0.0;
  std::optional<double> sigma_range_m;  ///< For this reading only; none: the common noise.
  std::optional<Eigen::Vector2d> spot_px;
  std::optional<Eigen::Vector3d> spot_ray;  ///< Unit ray of the spot, in the camera frame.
  double sigma_spot_px = 1.0;
  bool owns_spot_sigma = false;    ///< The shot has a σ of its own.
  double min_sigma_spot_px = 0.0;  ///< Lower bound of σ from its detector.
  std::optional<Plane> plane;      ///< Plane of the board; compared with the reading.
  std::optional<BoardPose> pose;   ///< If the plane comes from a board pose; else the covariance of the plane applies.
  const BoardView* board = nullptr;  ///< Its corners, if it has them.
  double corner_factor = 1.0;  ///< Factor on the corners' σ, from the board's fit: a close board shows its curvature.
  Eigen::Matrix<double, 6, Eigen::Dynamic> J_pose_lens;  ///< ∂ pose / ∂ lens; empty if it does not depend on it.
  bool used = true;  ///< For the beam: false for an outlier (its corners still determine the lens).

  [[nodiscard]] int num_rows() const { return (plane ? 1 : 0) + (spot_px ? 2 : 0); }
};

/// What the residuals depend on besides the shot: the reading counted once or twice, and the common noise.
struct ShotModel {
  RangeNoise noise;
  bool reading_counts_twice = false;
};

/// Residuals (prediction − observation) of one shot: the reading [m] if there is a plane, then the spot [px] if there
/// is one; with their derivatives and the covariance of the measurements. With a plane, the spot is predicted at the
/// intersection of beam and plane, so that each measurement is in one residual; without one, at the reading, whose
/// error then moves the spot along the image of the beam.
struct ShotResidual {
  using Rows = Eigen::Matrix<double, Eigen::Dynamic, 1, 0, 3, 1>;
  Rows r;
  Eigen::Matrix<double, Eigen::Dynamic, num_beam_params, 0, 3, num_beam_params> J_beam;
  Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3, 6> J_pose;   ///< With respect to ξ of the pose; zero without a pose.
  Eigen::Matrix<double, Eigen::Dynamic, 4, 0, 3, 4> J_plane;  ///< With respect to (normal, d) of the plane.
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 16> J_lens;
  Eigen::Matrix<double, Eigen::Dynamic, 3, 0, 3, 3> J_errors;                ///< Of reading [m] and spot [px].
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> noise_cov;  ///< Without that of the plane.
};

/// None if the beam does not intersect the plane in front, or the lens does not see the spot: such a step is rejected.
[[nodiscard]] std::optional<ShotResidual> shot_residual(const PreparedShot& shot, const Beam& beam,
                                                        const Camera& camera, const ShotModel& model);

/// Covariance of the residuals including that of the plane (pose).
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> full_covariance(
    const PreparedShot& shot, const ShotResidual& residual);

/// Lower-triangular L⁻¹ of cov = L Lᵀ: whitens residuals.
[[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> whitener_of(
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& cov);

}  // namespace alidade
