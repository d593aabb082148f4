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

/// How far two cameras are apart, by a tape or a survey; ids of their heads.
struct KnownDistance {
  int first = 0, second = 0;
  double distance_m = 0.0;
  double sigma_m = 0.0;
};

struct MovingTargetConfig {
  /// Above 0: each camera has a clock of its own, up to so many seconds from another's. 0: one clock.
  double clock_search_s = 0.0;
  std::optional<KnownDistance> distance = {};  ///< The scale, unless a true path gives it.
  std::optional<double> sigma_px =
      {};  ///< Of a coordinate of an observation; none: estimated from the residuals, head by head.
};

/// The fields of `config` that a person sets: clocks_s, distance, sigma_px.
[[nodiscard]] FieldList fields_of(MovingTargetConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(MovingTargetConfig config);

/// Time of the rig = offset + rate · time of the camera.
struct CameraClock {
  double offset_s = 0.0, rate = 1.0;
  [[nodiscard]] double in_rig(double t_s) const { return offset_s + rate * t_s; }
};

/// A moment before which, or after which, nearly all is rejected, and only few else.
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
  double sigma_clock_s = 0.0, sigma_rate = 0.0;  ///< Of the clock amid its observations, and of its rate.
  double sigma_px = 0.0;                         ///< Of a coordinate.
  double rms_px = 0.0;                           ///< Per point, of the used observations.
  double rejected = 0.0;                         ///< Share of its observations that do not agree with the path.
  std::optional<SplitMoment> moved;              ///< By its clock.
};

/// What is tested of a camera: its lens, by how much its clock is ahead, how long its shutter takes from the top row to
/// the bottom one (times being the middle row's, or the top one's), and a turn about its base's axes from the first
/// observation to the last.
enum class CameraPart { focal, cx, cy, k1, clock, shutter, shutter_from_top, turn_x, turn_y, turn_z };

/// The change of a camera that the observations indicate, all else estimated too: a score test.
struct CameraScore {
  std::size_t head = 0;
  CameraPart part = CameraPart::focal;
  double asked = 0.0,
         sigma = 0.0;  ///< Of both focal lengths, relative, or px, k1, s, rad; errors over time go together.
  double given = 0.0;  ///< σ that it has by errors of all files as these state them.
  [[nodiscard]] double sigmas() const { return std::abs(asked) / std::hypot(sigma, given); }
  double gain = 0.0;        ///< What it takes of the residuals' squares [σ of an observation, squared].
  Eigen::VectorXd follows;  ///< The solver's shared parameters for each unit asked.
};

/// Beyond so many σ a camera is reported as another, as a rig's causes are.
constexpr double camera_limit = 4.2;

struct MovingTargetReport {
  enum class Status {
    placed,
    too_few,        ///< No two cameras saw the target together often enough.
    no_pair,        ///< No two cameras' observations agree at any time between their clocks.
    degenerate,     ///< The path is too simple (a straight line), or too far away.
    no_scale,       ///< Neither a distance nor a true path is given.
    truth_misfits,  ///< The true path given is not the one that was seen.
    no_convergence
  };
  Status status = Status::too_few;
  Rig rig;                             ///< All heads; those that were not located are as given.
  std::vector<LocatedCamera> cameras;  ///< One per head.
  std::vector<bool> used;              ///< One per observation.
  std::vector<double> path_t_s;        ///< Times of the rig, where two cameras or more saw the target.
  std::vector<Eigen::Vector3d> path;   ///< The target then.
  double chi2_per_dof = 0.0;
  double sigma_scale = 0.0;         ///< Relative; of the distance or of the fit to the true path.
  Eigen::MatrixXd cov_model;        ///< As rig.cov, with independent observations and exact lenses.
  ClusterCovariance clusters;       ///< Blocks of time, by the solver's own parameters.
  double block_s = 0.0;             ///< Length of a block.
  std::string camera_fault;         ///< What is wrong with a camera, where that is identified; empty: nothing.
  std::vector<Assumption> assumed;  ///< Lenses and the distance.
  std::vector<CameraScore> scores;  ///< Of located cameras, what the observations determine.
  double sigma_relative_m = 0.0, sigma_relative_rad = 0.0;  ///< Worst camera, in the first one's frame.
  double sigma_world_m = 0.0, sigma_world_rad = 0.0;        ///< The same in the true path's frame; 0 without one.
  /// With a true path: its clock (time of the rig by its own), and the residuals of the similarity, over the path.
  CameraClock truth_clock;
  double truth_median_m = 0.0, truth_rms_m = 0.0;
  /// Share of the time in which two or more located cameras saw the target that has a path.
  double agreeing = 1.0;
  std::optional<SplitMoment> disagree;  ///< Time of the rig.
  double truth_covered = 0.0;           ///< Share of the path that it covers.
  /// By how much its times are late where clocks are not searched, and σ [s].
  double truth_late_s = 0.0, sigma_truth_late_s = 0.0;
  int iterations = 0;
};

/// The result of network(): what the solve found (rig, cameras, path …), with its covariance, counts and
/// verdict.
struct NetworkCalibration : MovingTargetReport {
  std::vector<TargetObservation> observations;  ///< As given; `used` says what became of each.
  MovingTargetConfig config;
  Eigen::MatrixXd covariance;                ///< Of the heads that were located: located_rig().cov.
  std::vector<std::string> parameter_names;  ///< Of `covariance`: "head1.base_x_m", …
  Counts counts;                             ///< Of observations.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
