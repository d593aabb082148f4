#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/imu/imu_factors.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// An observation of a point of the map.
struct UsedObservation {
  std::size_t frame = 0;  ///< Index, counted from the smoother's first frame.
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.5;
  bool fits_start = true;  ///< Whether it fits the initial poses and points.
};

struct SmootherPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();  ///< Initial guess.
  std::optional<Eigen::Vector3d> given_in_world;             ///< For a known point; sigma_m: σ of each coordinate.
  double sigma_m = 0.001;
  double error_factor = 1.0;        ///< σ of its image errors over the stated one.
  std::size_t first_frame = 0;      ///< The frame in which its distance had the prior
  std::optional<RangePrior> range;  ///< `range`.
};

/// An observation and its residual, observed − predicted.
struct PlacedResidual {
  std::size_t frame = 0;
  long id = 0;
  Eigen::Vector2d px, residual_px;
  double sigma_px = 0.5;      ///< As stated,
  double error_factor = 1.0;  ///< and the factor by which the errors of this point are larger.
  std::size_t index = 0;      ///< Index among the observations of the path.
};

/// The gauge freedom of a path: if there is some, its covariance is that after the best alignment.
enum class PathGauge {
  fixed,       ///< None: fixed by a start or by known points.
  motion,      ///< Position and rotation: the first camera defines the frame.
  similarity,  ///< The unit of length as well.
};

/// An IMU's readings in the camera's axes and on its clock, with prior σ of their errors.
struct SmootherImu {
  std::vector<ImuReading> readings;
  ImuNoise noise;
  ImuState start;  ///< Initial guess; its position in the camera is the given one.
  double gravity_m_s2 = 9.81, sigma_gravity_m_s2 = 0.02;
  double sigma_rotation_rad = 0.02, sigma_position_m = 0.01, sigma_late_s = 0.01, sigma_clock_rate = 2e-4;
};

/// The part of the estimate that concerns the IMU.
struct SmoothedImu {
  ImuState state;
  Eigen::VectorXd sigma;      ///< Of all its components.
  double sigma_scale = 0.0;   ///< Relative σ of the path's extent.
  double target_scale = 0.0;  ///< Relative change of the target's size that it indicates, if there is a target,
  double sigma_target = 0.0;  ///< and its σ.
  double rate_noise_factor = 1.0, force_noise_factor = 1.0;  ///< Factors by which σ was enlarged.
  double rate_walk_factor = 1.0, force_walk_factor = 1.0;    ///< The same for the biases' random walks.
  std::size_t num_steps = 0, num_rejected = 0, num_missing = 0;
};

/// Input of the smoother. Frames are consecutive.
struct SmootherProblem {
  std::size_t first_frame = 0;  ///< Index in the recording.
  Camera camera;                ///< As given; its covariance is included in the result.
  std::vector<double> t_s;
  std::vector<bool> is_jump;                  ///< Frames whose pose does not follow from motion. Empty: none.
  std::vector<Rigid3> world_from_cam;         ///< Initial guess.
  std::vector<UsedObservation> observations;  ///< In order of frames.
  std::vector<SmootherPoint> points;
  bool weighs_points = true;    ///< By their residuals, see path_weights.cpp; else with their given error factors,
  double usual_variance = 1.0;  ///< and with this typical variance of the points' errors, over the stated one.
  std::optional<StartHypothesis>
      start;  ///< Given first pose; without it only its velocities are given, zero with these σ:
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;
  double period_s = 1.0 / 30.0;  ///< Time between two changes of the random acceleration.
  PathGauge gauge = PathGauge::fixed;
  double sigma_scale = 0.0;  ///< σ of the known points' common scale: considered, not estimated.
  bool frees_lens = false;   ///< Whether a lens that the observations contradict is estimated, without prior.
  /// The lens is freed only where it explains more than a readout time; if set, also more than a shape and motion of
  /// the target, which the observations of a table reveal.
  bool compares_causes = false;
  std::optional<Lens> freed_lens;   ///< Initial guess of a lens that was already freed.
  std::optional<SmootherImu> imu;   ///< Its unit of length is then the metre.
  LocalizationFilterConfig filter;  ///< σ of accelerations, the gate, and the estimated lens parameters.
};

/// Maximum a posteriori estimate of path, map and lens, with covariance. The given covariance of the lens and the
/// target's scale, unless estimated, are consider parameters (S. F. Schmidt 1966).
struct SmoothedPath {
  std::vector<Rigid3> world_from_cam;
  std::vector<Eigen::Matrix<double, 6, 6>> cov;  ///< Of the right perturbation.
  std::vector<long> ids;                         ///< Of the points, ascending.
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Matrix3d> point_covs;
  SavedFrame frame;                          ///< Common error of the points, if the frame is a given one,
  std::vector<Eigen::Matrix3d> covs_in_map;  ///< and the covariances of the points within it.
  std::vector<double> error_factors;         ///< One per point.
  double usual_variance = 1.0;               ///< Median of the points' variances, over the stated one.
  Camera camera;
  bool is_lens_freed = false;
  std::vector<int> estimated;  ///< Indices of the estimated lens parameters,
  Eigen::VectorXd sigma_lens;  ///< and their σ.
  double lens_pull = 0.0;  ///< Largest deviation of an estimated lens parameter from the given one, in the given σ.
  std::vector<GivenNumber> given;
  /// Changes of poses and points by the σ of an undetectable error of focal length or centre; part of the covariances.
  struct Hidden {
    std::vector<Eigen::Vector<double, 6>> poses;
    std::vector<Eigen::Vector3d> points;
  };
  std::vector<Hidden> hidden;
  std::vector<PlacedResidual> residuals;
  ResidualStructure structure;  ///< Autocorrelated errors are modelled in the path.
  RadialStructure radial;
  double chi2_per_dof = 0.0;  ///< Over the observations that fit.
  /// Factor by which σ is enlarged along the least certain direction, because the cost rises more slowly there, at
  /// least to one side, than σ implies.
  double widened = 1.0;
  /// The camera hardly translates, and the least certain components of a pose have a σ beyond the linear range:
  /// rotations and small translations look alike where depths are unknown, and the posterior is not Gaussian.
  bool is_from_one_place = false;
  std::size_t num_dropped = 0;  ///< Observations that do not fit it.
  std::optional<SmoothedImu> imu;
};

/// Batch smoothing of all observations of a recording. A filter linearises each at the estimate of its time, with
/// vague depths, so that the unobservable directions (frame, scale) differ between updates and the filter gains
/// spurious information. Here all are linearised at the solution. Gauss–Newton over poses, points and lens, with
/// the motion model of the filter; poses are eliminated one after another (pose_chain.h). Empty if it does not
/// converge.
[[nodiscard]] std::optional<SmoothedPath> smoothed_path(const SmootherProblem& problem);

/// Σ of squared residuals over σ² for the observations that fit, plus the gate for each other one; with σ as stated, or
/// as estimated for each point.
enum class CostBy { stated_sigma, found_sigma };
[[nodiscard]] double cost_of(const SmoothedPath& path, double gate, CostBy by = CostBy::stated_sigma);

/// The same problem with an initial guess that is independent of the filter: all points at the same depth, and each
/// pose by resection from the one before. Without known depths, the first seconds of a filter may end with a rotation
/// mistaken for a translation. Empty if there is no such guess.
[[nodiscard]] std::optional<SmootherProblem> flat_start(const SmootherProblem& problem);

}  // namespace alidade
