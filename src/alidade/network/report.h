#pragma once

#include <cmath>
#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rig.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Known distance between two cameras, from a tape or a survey; ids of their heads.
struct KnownDistance {
  int first = 0, second = 0;
  double distance_m = 0.0;
  double sigma_m = 0.0;
};

struct MovingTargetConfig {
  /// Above 0: each camera has its own clock, off by up to this many seconds from another's. 0: one common clock.
  double clock_search_s = 0.0;
  std::optional<KnownDistance> distance = {};  ///< Provides the scale, unless a true path does.
  std::optional<double> sigma_px =
      {};  ///< Of a coordinate of an observation; none: estimated from the residuals, separately for each head.
};

/// The fields of `config` that a user sets: clocks_s, distance, sigma_px.
[[nodiscard]] FieldList fields_of(MovingTargetConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(MovingTargetConfig config);

/// Time of the rig = offset + rate · time of the camera.
struct CameraClock {
  double offset_s = 0.0, rate = 1.0;
  [[nodiscard]] double in_rig(double t_s) const { return offset_s + rate * t_s; }
};

/// A time that separates nearly all rejected from few rejected observations.
struct SplitMoment {
  double t_s = 0.0;
  bool agrees_before = true;
};

/// One camera after the solve.
struct LocatedCamera {
  int id = 0;
  bool placed = false;
  std::string reason;  ///< Why it was not located; empty otherwise.
  std::size_t num_observations = 0, num_used = 0;
  CameraClock clock;
  double sigma_clock_s = 0.0, sigma_rate = 0.0;  ///< σ of the clock at the centre of the observations, and of its rate.
  double sigma_px = 0.0;                         ///< σ of one coordinate.
  double rms_px = 0.0;                           ///< Per point, over the used observations.
  double rejected = 0.0;                         ///< Fraction of its observations that are inconsistent with the path.
  std::optional<SplitMoment> moved;              ///< When the camera was moved, on its own clock.
};

/// What is tested of a camera: its lens; its clock being ahead; the readout time of its shutter from the top row to the
/// bottom row (with time stamps of the middle row, or of the top row); a rotation about the axes of its base that grows
/// from the first observation to the last.
enum class CameraPart { focal, cx, cy, k1, clock, shutter, shutter_from_top, turn_x, turn_y, turn_z };

/// A change of one camera that the observations indicate, everything else re-estimated: a score test.
struct CameraScore {
  std::size_t head = 0;
  CameraPart part = CameraPart::focal;
  double asked = 0.0,
         sigma = 0.0;  ///< Relative (both focal lengths), px, k1, s or rad; σ allows for errors correlated in time.
  double given = 0.0;  ///< σ of `asked` due to the errors of all files, as the files state them.
  [[nodiscard]] double sigmas() const { return std::abs(asked) / std::hypot(sigma, given); }
  double gain = 0.0;        ///< Reduction of the sum of squared residuals [σ of an observation, squared].
  Eigen::VectorXd follows;  ///< Change of the solver's shared parameters per unit of `asked`.
};

/// Significance [σ] above which such a change is reported, as for the causes of a rig.
constexpr double camera_limit = 4.2;

struct MovingTargetReport {
  enum class Status {
    placed,
    too_few,        ///< No two cameras observed the target together often enough.
    no_pair,        ///< No offset between their clocks makes any two cameras' observations agree.
    degenerate,     ///< The path is too simple (a straight line), or too far away.
    no_scale,       ///< Neither a distance nor a true path is given.
    truth_misfits,  ///< The given true path is not that of the observed target.
    no_convergence
  };
  Status status = Status::too_few;
  Rig rig;                             ///< All heads; cameras that were not located keep their given pose.
  std::vector<LocatedCamera> cameras;  ///< One per head.
  std::vector<bool> used;              ///< One per observation.
  std::vector<double> path_t_s;        ///< In rig time, where two or more cameras saw the target.
  std::vector<Eigen::Vector3d> path;   ///< Estimated positions of the target at these times.
  double chi2_per_dof = 0.0;
  double sigma_scale = 0.0;         ///< Relative; of the distance, or of the fit to the true path.
  Eigen::MatrixXd cov_model;        ///< Like rig.cov, for independent observations and exact lenses.
  ClusterCovariance clusters;       ///< Blocks of time; of the solver's own parameters.
  double block_s = 0.0;             ///< Length of a block.
  std::string camera_fault;         ///< What is wrong with a camera, where this can be identified; empty: nothing.
  std::vector<Assumption> assumed;  ///< Lenses and the distance.
  std::vector<CameraScore> scores;  ///< Of located cameras; only what the observations determine.
  double sigma_relative_m = 0.0, sigma_relative_rad = 0.0;  ///< Worst camera, in the frame of the first.
  double sigma_world_m = 0.0, sigma_world_rad = 0.0;        ///< The same in the frame of the true path; 0 without one.
  /// With a true path: its clock (rig time from its time), and the residuals after a similarity transform.
  CameraClock truth_clock;
  double truth_median_m = 0.0, truth_rms_m = 0.0;
  /// Fraction of the time in which two or more located cameras saw the target and their observations give a path.
  double agreeing = 1.0;
  std::optional<SplitMoment> disagree;  ///< When they begin or cease to agree, in rig time.
  double truth_covered = 0.0;           ///< Fraction of the path that the true path covers.
  /// Delay of the true path's times, if clocks are not searched, and its σ [s].
  double truth_late_s = 0.0, sigma_truth_late_s = 0.0;
  int iterations = 0;
};

/// The result of network(): what was estimated (rig, cameras, path …), with its covariance, counts and
/// verdict.
struct NetworkCalibration : MovingTargetReport {
  std::vector<TargetObservation> observations;  ///< As given; see `used` for the use of each.
  MovingTargetConfig config;
  Eigen::MatrixXd covariance;                ///< Of the located heads: located_rig().cov.
  std::vector<std::string> parameter_names;  ///< Of `covariance`: "head1.base_x_m", …
  Counts counts;                             ///< Number of observations.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
