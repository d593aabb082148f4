#pragma once

#include <array>
#include <limits>
#include <span>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/observe/solve/rotation_model.h"

namespace alidade {

/// Observation of a point.
struct BundleObservation {
  int frame = 0;
  int point = 0;
  Eigen::Vector2d px;  ///< Normalised.
};

/// Measured distance of a point from the camera centre.
struct BundleRange {
  int frame = 0;
  int point = 0;
  double range_m = 0.0;
};

/// The measurements of one adjustment. `frames[i].px` are not used. Points of different segments are
/// different points.
struct RotationBundle {
  std::vector<RotationFrame> frames;
  std::vector<BundleObservation> observations;
  std::vector<BundleRange> ranges;
  RotatingCamera camera;             ///< Initial guess.
  std::vector<BearingPoint> points;  ///< Initial guess.
};

struct RotationBundleConfig {
  ObserveNuisances nuisances;
  bool with_depth = false;  ///< Points have a depth: needed for a lever arm or a measured velocity.
  double sigma_px = 1e-3;   ///< σ of each observation's coordinates, normalised.
  double sigma_range_m = 1e-3;
  double sigma_rotation_rad = 0.0;  ///< σ of each frame's rotation, with nuisances.rotation; infinite: not measured.
  double sigma_rate_rad_per_s =
      0.0;             ///< If positive, rotations are integrated rates with this white noise per sample: a random walk.
  double huber = 2.5;  ///< Huber threshold [σ]: larger residuals are downweighted. 0: least squares.
  int max_iterations = 60;
  bool gives_up = false;  ///< Stops early if convergence seems unlikely and residuals are many σ.
};

/// Prior of the shared parameters: normal distributions, weak unless given.
struct CommonPrior {
  explicit CommonPrior(const RotatingCamera& mean_in);
  RotatingCamera mean;
  Eigen::Vector4d sigma_k;           ///< fx, fy: half their value; cx, cy: a quarter of the image.
  std::array<bool, 4> is_given_k{};  ///< sigma_k is given by the user, not weak.
  double sigma_aspect = std::numeric_limits<double>::infinity();  ///< σ of fx − fy, if given (square pixels).
  double sigma_k1 = 0.5;                                          ///< k2, k3 too.
  double sigma_tangential = 0.05;
  double sigma_mount_rad = 0.2;
  double sigma_delay_s = 0.1;
  double sigma_lever_m = 0.3;
  double sigma_shutter_s = 0.05;
  double sigma_drift_per_s = 0.01;
  double sigma_error = 1.0;  ///< σ of errors of the rotation, in units of their typical sizes: counts as given.

  [[nodiscard]] CommonMatrix information(const CommonLayout& layout) const;
  /// Only the part that the user gave.
  [[nodiscard]] CommonMatrix given_information(const CommonLayout& layout) const;
  /// Values minus the mean, in the layout's order.
  [[nodiscard]] CommonVector offset(const CommonLayout& layout, const RotatingCamera& camera) const;
  /// The same prior with its weak components centred on `camera`.
  [[nodiscard]] CommonPrior about(const RotatingCamera& camera) const;
};

/// Covariance of a point given the shared parameters c: point = point_mean + slope (c − c_mean) + e, e ~ N(0, cov), as
/// its part of the joint covariance. Inverse depth is the third coordinate, if there is one.
using PointByCommonSlope = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, max_common>;
struct PointGivenCommon {
  PointByCommonSlope slope;
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
};

struct BundleSolution {
  bool converged = false;
  int iterations = 0;
  RotatingCamera camera;
  std::vector<BearingPoint> points;
  std::vector<Eigen::Quaterniond> mount_from_start;  ///< One per frame, including the estimated rotation.
  CommonMatrix information;  ///< Information on the shared parameters except rotation, without prior and with all
                             ///< else eliminated, in units of 1/σ².
  CommonMatrix prior_information;
  CommonVector prior_gradient;                 ///< Gradient of half the prior's cost.
  CommonMatrix given_information;              ///< The part of the prior that the user gave.
  std::vector<PointGivenCommon> given_common;  ///< One per point; empty if rotations are estimated.
  // If the rotation of each frame is estimated, one per frame:
  std::vector<Eigen::Vector3d> rotation_errors;   ///< Errors of the measured rotation [rad].
  std::vector<double> rotation_information;       ///< 1/σ² of the rotation, or of its step from the frame before.
  std::vector<double> rotation_information_seen;  ///< Added by the frame's own pixels, mean over three axes.
  bool rotations_walk = false;                    ///< True: the prior is a random walk (steps).
  std::vector<Eigen::Vector2d> residuals;         ///< Prediction minus pixel, one per observation, normalised.
  std::vector<double> residual_px;                ///< Their norms.
  double sum_squares = 0.0;                       ///< Sum of squares of the weighted residuals over σ.
  double rms_px = 0.0;                            ///< Per coordinate, normalised, unweighted.
  int dof = 0;                                    ///< Measurements minus unknowns.

  [[nodiscard]] CommonMatrix covariance() const;
  /// Cramér–Rao bound at the solution, without the weak prior. Not finite if the data do not determine it.
  [[nodiscard]] CommonMatrix bound() const;
};

/// Rotation-only bundle adjustment: Levenberg–Marquardt on the shared parameters, all points and (with
/// nuisances.rotation) the rotation of each frame; points are eliminated block by block (Schur complement), so that the
/// time is linear in their number. Throws Interrupted. Triggs, McLauchlan, Hartley & Fitzgibbon, "Bundle adjustment — a
/// modern synthesis", 2000, section 6.
[[nodiscard]] BundleSolution solve_rotation_bundle(const RotationBundle& bundle, const CommonPrior& prior,
                                                   const RotationBundleConfig& config, const Progress& progress = {});

/// Robust σ of a coordinate from the residuals: their median norm over √(2 ln 2), corrected for the degrees of freedom.
[[nodiscard]] double robust_sigma(std::vector<double> residual_norms, int dof);

}  // namespace alidade
