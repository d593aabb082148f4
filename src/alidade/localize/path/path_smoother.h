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
  std::size_t frame = 0;  ///< Index from the smoother's first.
  long id = 0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  double sigma_px = 0.5;
  bool fits_start = true;  ///< With the poses and points that the smoother begins at.
};

struct SmootherPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();  ///< To begin at.
  std::optional<Eigen::Vector3d> given_in_world;             ///< Of a known point, with its σ of each coordinate.
  double sigma_m = 0.001;
  double error_factor = 1.0;        ///< σ of where it is seen, over the stated one.
  std::size_t first_frame = 0;      ///< Where its distance had the prior
  std::optional<RangePrior> range;  ///< this.
};

/// Where a point was seen, and that less where it is expected.
struct PlacedResidual {
  std::size_t frame = 0;
  long id = 0;
  Eigen::Vector2d px, residual_px;
  double sigma_px = 0.5;      ///< As stated,
  double error_factor = 1.0;  ///< and how much larger the errors of this point are found to be.
  std::size_t index = 0;      ///< Among the observations of the path.
};

/// The gauge freedom of a path: where there is some, its covariance is that after the best alignment.
enum class PathGauge {
  fixed,       ///< None: a start or known points fix it.
  motion,      ///< Position and rotation: the first camera is the world.
  similarity,  ///< Its unit of length as well.
};

/// An IMU's readings in the camera's axes and at its times, and what is known of their errors.
struct SmootherImu {
  std::vector<ImuReading> readings;
  ImuNoise noise;
  ImuState start;  ///< To begin at; its place in the camera is the given one.
  double gravity_m_s2 = 9.81, sigma_gravity_m_s2 = 0.02;
  double sigma_rotation_rad = 0.02, sigma_position_m = 0.01, sigma_late_s = 0.01, sigma_clock_rate = 2e-4;
};

/// What of it a path found.
struct SmoothedImu {
  ImuState state;
  Eigen::VectorXd sigma;      ///< Of all its numbers.
  double sigma_scale = 0.0;   ///< Of the path's extent, over it.
  double target_scale = 0.0;  ///< Relative change of the target's size that it indicates, where there is one,
  double sigma_target = 0.0;  ///< and its σ.
  double rate_noise_factor = 1.0, force_noise_factor = 1.0;  ///< By which σ was enlarged.
  double rate_walk_factor = 1.0, force_walk_factor = 1.0;    ///< By which the biases' walks were.
  std::size_t num_steps = 0, num_rejected = 0, num_missing = 0;
};

/// What a path is smoothed from. Frames follow each other without a break.
struct SmootherProblem {
  std::size_t first_frame = 0;  ///< Of the recording.
  Camera camera;                ///< As given; its covariance is counted.
  std::vector<double> t_s;
  std::vector<bool> is_jump;                  ///< To these frames the camera came by no motion. May be empty: to none.
  std::vector<Rigid3> world_from_cam;         ///< To begin at.
  std::vector<UsedObservation> observations;  ///< In order of frames.
  std::vector<SmootherPoint> points;
  bool weighs_points = true;    ///< By their residuals, as path_weights.cpp has it; else by the factors that they have,
  double usual_variance = 1.0;  ///< and with this of the points' usual errors, over the stated one.
  std::optional<StartHypothesis>
      start;  ///< What was given of the first pose; else its speeds alone, zero with these σ:
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;
  double period_s = 1.0 / 30.0;  ///< Accelerations are drawn again for each.
  PathGauge gauge = PathGauge::fixed;
  double sigma_scale = 0.0;  ///< Of the known points' common scale, counted and not estimated.
  bool frees_lens = false;   ///< A lens that the observations contradict is estimated, without what was given of it.
  /// That only where a readout explains less; and with this shape and speed of the target, too, which observations of a
  /// table show.
  bool compares_causes = false;
  std::optional<Lens> freed_lens;   ///< Estimated so, to begin at where it already was.
  std::optional<SmootherImu> imu;   ///< Its unit of length is then the metre.
  LocalizationFilterConfig filter;  /// σ of accelerations, the gate, and what of the lens is estimated.
};

/// Path, map and lens at the maximum of their common posterior, with its covariance; the lens's own covariance and the
/// target's scale counted, where they are not estimated (S. F. Schmidt 1966: consider parameters).
struct SmoothedPath {
  std::vector<Rigid3> world_from_cam;
  std::vector<Eigen::Matrix<double, 6, 6>> cov;  ///< Of the right perturbation.
  std::vector<long> ids;                         ///< Of the points, growing.
  std::vector<Eigen::Vector3d> points;
  std::vector<Eigen::Matrix3d> point_covs;
  SavedFrame frame;  ///< What the points' errors have in common, where the frame is a given one,
  std::vector<Eigen::Matrix3d> covs_in_map;  ///< and what of them is beside it.
  std::vector<double> error_factors;         ///< Of the points.
  double usual_variance = 1.0;               ///< The median of theirs, over the stated one.
  Camera camera;
  bool is_lens_freed = false;
  std::vector<int> estimated;  ///< Of the lens's parameters,
  Eigen::VectorXd sigma_lens;  ///< and their σ.
  double lens_pull = 0.0;      ///< How far an estimated number of the lens is from what was given, in the given σ.
  std::vector<GivenNumber> given;
  /// Moves of poses and points by the σ of what of a focal length or centre does not show: they are in the covariances.
  struct Hidden {
    std::vector<Eigen::Vector<double, 6>> poses;
    std::vector<Eigen::Vector3d> points;
  };
  std::vector<Hidden> hidden;
  std::vector<PlacedResidual> residuals;
  ResidualStructure structure;  ///< Autocorrelated errors are modelled in the path.
  RadialStructure radial;
  double chi2_per_dof = 0.0;  ///< Of the observations that fit.
  /// Along its least certain direction the cost rises more slowly to one side than to the other, or than σ says; σ is
  /// enlarged there by so much.
  double widened = 1.0;
  /// The camera hardly moves aside, and so a pose's least certain components are less sure than a cut is straight:
  /// turns and small moves look alike where depths are not known, and the posterior is no Gaussian.
  bool is_from_one_place = false;
  std::size_t num_dropped = 0;  ///< Observations that do not fit it.
  std::optional<SmoothedImu> imu;
};

/// Batch smoothing of all observations of a recording: a filter linearises each at the estimate of its time, with vague
/// depths, so that unobservable directions (frame, scale) differ between updates and information is gained that no
/// observation gave. Here all are linearised at one point, the solution. Gauss–Newton over poses, points and
/// lens with the filter's own motion model; poses are eliminated one after another (pose_chain.h). None where it
/// does not converge.
[[nodiscard]] std::optional<SmoothedPath> smoothed_path(const SmootherProblem& problem);

/// Squares over σ² of the observations that fit, and the gate for each other one: σ as stated, or as each point's
/// errors are found.
enum class CostBy { stated_sigma, found_sigma };
[[nodiscard]] double cost_of(const SmoothedPath& path, double gate, CostBy by = CostBy::stated_sigma);

/// The same problem from another initial guess, which owes nothing to the filter: every point as deep as the others,
/// and each pose by resection from the one before. Where no depth is known a filter's first seconds may end in a
/// rotation that passes for a translation. None where there is no such guess.
[[nodiscard]] std::optional<SmootherProblem> flat_start(const SmootherProblem& problem);

}  // namespace alidade
