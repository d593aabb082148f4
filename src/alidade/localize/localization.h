#pragma once

#include <Eigen/Core>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/localize/imu/imu_estimate.h"
#include "alidade/localize/saved_map.h"
#include "alidade/localize/sequence.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class FrameEvent {
  waiting,  ///< Not initialised yet: no pose.
  started,
  tracked,
  predicted,  ///< Fewer than three points used: the pose is mostly the motion model's.
  restarted,
};
[[nodiscard]] std::string_view event_name(FrameEvent event);

/// Source of σ of a pixel coordinate.
enum class SigmaPxFrom {
  usual,      ///< The default: none was given, and the observations do not contradict it.
  given,      ///< Given in the config.
  rows,       ///< Each observation states its own.
  residuals,  ///< Estimated from the residuals.
};
[[nodiscard]] std::string_view source_name(SigmaPxFrom from);

/// One frame of the path.
struct PathStep {
  long frame = 0;
  double t_s = 0.0;
  FrameEvent event = FrameEvent::waiting;
  Rigid3 world_from_cam;
  Eigen::Matrix<double, 6, 6> cov =
      Eigen::Matrix<double, 6, 6>::Zero();  ///< Covariance of the right perturbation: translation [m], rotation [rad].
  std::size_t num_seen = 0, num_tracked = 0, num_gated = 0, num_features = 0;
  std::size_t num_known = 0, num_known_gated = 0;  ///< Points of the target among those used and gated.
  double nis_per_dof = std::numeric_limits<double>::quiet_NaN();
  double seconds = 0.0;

  [[nodiscard]] bool has_pose() const { return event != FrameEvent::waiting; }
};

struct MapPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  bool is_known = false;
  std::size_t num_seen = 0;
  /// Covariance without the errors that all points share (saved_map.frame). None: these are not known separately.
  std::optional<Eigen::Matrix3d> cov_in_map = {};
};

/// A parameter taken as given: how an error in it would move the path, and its score (Lagrange multiplier) test: the
/// value that it would take if it were estimated too, by the linearisation at the solution.
struct GivenNumber {
  /// "focal length", "centre u", "centre v", "k1", "scale of the target", "shape of the target", "speed of the target",
  /// "rotation of the target", "readout" (of a rolling shutter, first row to last), "clock"
  std::string_view name;
  double moves = 0.0;           ///< Largest change of a pose component per unit (relative, px, m/s, s), in its σ;
  std::string_view moved = {};  ///< the name of that component,
  double moved_by = 0.0;        ///< and its change [m or rad].
  double asked = 0.0, z = 0.0;  ///< Change indicated by the score test, in units; z: over its σ.
  std::optional<double> sigma;  ///< Included in σ of the path, in units. None: not known.
  /// For the focal length, and with a target the centre: errors up to `hidden` would not show in the score. σ of the
  /// path includes `sigma_hidden` of it, so that they move no pose by more than 4σ; for a centre that is hardly
  /// observable, also no combination of a pose's components.
  double hidden = 0.0, sigma_hidden = 0.0;
};

/// Scale of the path by another sensor.
struct SensorScale {
  std::string sensor;      ///< "depth sensor", "rangefinder", "odometry", "IMU"
  double scale = 1.0;      ///< Metres per unit of the path without it; 1 where a target gave correct metres.
  double sigma_rel = 0.0;  ///< σ of the scale, relative. 0: the readings do not determine it.
  std::size_t num_used = 0, num_rejected = 0;
  bool is_in_time = true;  ///< Some readings lie within the time span of the path.
  double late_s = 0.0;     ///< Sensor clock minus camera clock, where they differ: corrected.
  double offset_m = 0.0;   ///< Excess of a rangefinder's readings, if any: corrected.
  double aside_rad = 0.0;  ///< Angle between a rangefinder's beam and the given one, if any: corrected.
  /// Relative error of the scale if a rangefinder read 0.1 m too long, where such an offset would not show; else 0.
  double hidden_offset_rel = 0.0;
  double lag_s = 0.0;                 ///< Time constant of a depth sensor's or odometry's filter, if any: corrected.
  double acceleration = 0.0;          ///< RMS acceleration of the camera by this scale, over the given one.
  double jump_m = 0.0, jump_s = 0.0;  ///< Step in a depth sensor's readings and its time, if any: corrected.
  /// ln of another scale over this one that a rangefinder's readings support too, of another surface; else 0.
  double other_log_scale = 0.0;
  bool is_drifting = false;
  double drift_m = 0.0;  ///< Change of a depth sensor's offset from start to end, where it drifts: corrected.
  /// Position of a depth sensor in the camera's frame and its σ, where it differs from the given one; else 0.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero(), sigma_arm_m = Eigen::Vector3d::Zero();
  double arm_given_m = 0.0;  ///< Distance of the depth sensor from the camera, as given.
  double arm_effect = 0.0;   ///< Change of ln scale if that position is 1 cm off, where it has no σ.
  /// Interval in which odometry's wheels slip most, and its length over the path's there: rejected. 0: no slip.
  double slip_from_s = 0.0, slip_to_s = 0.0, slip_ratio = 0.0;
  std::string unit;           ///< Unit of the readings, where a target shows that it is not metres ("cm"): used.
  bool is_too_fast = false;   ///< By this scale the camera would accelerate too much: not used.
  double noise_factor = 1.0;  ///< RMS of a depth sensor's residuals, over their σ.
};

/// Mean radial residual in rings about the principal point.
struct RadialStructure {
  double share = 0.0;          ///< RMS over the rings of the mean residual over σ: 0 for a correct lens.
  double chi2_per_ring = 0.0;  ///< Mean square of these means over their own σ, for independent observations.
  double worst_px = 0.0;       ///< The largest mean residual.
};

/// Dependence between residuals that should be independent.
struct ResidualStructure {
  double autocorrelation = 0.0;        ///< Correlation of a point's residuals in consecutive frames.
  double sigma_autocorrelation = 1.0;  ///< σ of that correlation for independent residuals.
  /// Whether that is significant and large enough to matter.
  [[nodiscard]] bool is_autocorrelated() const {
    return autocorrelation > 0.25 && autocorrelation > 4.0 * sigma_autocorrelation;
  }
  double mean_chi2 = 0.0;        ///< χ² of the mean residuals of 4 × 3 regions, over their count: 1 if correct.
  double mean_chi2_limit = 1e9;  ///< 99.9 % quantile of that.
  double worst_px = 0.0;         ///< The largest mean,
  std::string worst_region;      ///< and where: "upper left".
};

/// Frames of a constant rate that seem to be missing before a frame of the path, though its time shows no gap.
struct MissingFrames {
  std::size_t before = 0;  ///< Index of that frame in the path.
  int num = 0;
};

/// Points of an earlier run's map that are no longer where the map has them. They enter the map of this path as new
/// points.
struct MovedPoints {
  std::size_t num = 0, num_judged = 0;  ///< Points that moved, of those that could be judged.
  std::size_t num_as_one = 0;           ///< Moved points that moved together.
  double median_m = 0.0;                ///< Median distance; 0: not known.
  bool is_left_out = true;              ///< The path is estimated from the others alone.
};

/// The group of a target's points that most clearly lies elsewhere than given relative to the rest. The mean of a group
/// shows a shift that is within σ of each single point.
struct MovedPart {
  std::size_t num = 0, num_given = 0;  ///< Points in the group; target points in the map (0: too few to test).
  double shift_m = 0.0, chi2 = 0.0;    ///< Shift that explains most, and its χ² (3 degrees of freedom).
  double spread = 0.0;                 ///< Largest variance of all errors along a direction, over σ²: 1 if correct,
  double spread_limit = 1e9;           ///< and its 99.9 % limit.
};

/// How far an estimated path is from the true one. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM
/// Systems", IROS 2012: ATE is the RMS distance of positions after alignment; RPE the RMS translation of (Q_i⁻¹
/// Q_i+1)⁻¹ (P_i⁻¹ P_i+1) between neighbours, with the aligned scale.
struct PathError {
  double ate_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_rad = std::numeric_limits<double>::quiet_NaN();  ///< RMS rotation of the same steps.
  double unaligned_m = std::numeric_limits<double>::quiet_NaN();
  double scale = 1.0;  ///< Truth over estimate.
  /// RMS of the positions' stated σ (root of the trace), with the aligned scale. `ate_m` should not exceed it, because
  /// an alignment removes errors and adds none.
  double stated_m = std::numeric_limits<double>::quiet_NaN();
  /// Mean of dᵀ Σ⁻¹ d of the poses without alignment, over 6 (Bar-Shalom, eq. 5.4.2-3); NaN if the truth is in another
  /// frame: farther from the path than 10 σ and a tenth of its size, or rotated by more than 0.2 rad.
  double nees_per_dof = std::numeric_limits<double>::quiet_NaN();
  /// The same for the aligned positions, over 3. Σ is in the path's frame and includes errors shared by all frames,
  /// which the alignment removes: a value far below 1 is no fault, a value above 1 is.
  double nees_aligned_per_dof = std::numeric_limits<double>::quiet_NaN();
  std::size_t num_pairs = 0;
};

/// The result of localize(): the path, the map, and the verdict.
struct Localization {
  std::vector<PathStep> path;  ///< One per frame.
  std::vector<MapPoint> map;   ///< The final map.
  SavedMap saved_map;          ///< Map for another run to start in: points whose position is known well enough.
  bool scale_known = false;
  bool is_scale_read = false;              ///< Known by `sensor_scales`, not by a target.
  std::vector<SensorScale> sensor_scales;  ///< One per sensor with readings.
  double sigma_target_scale = 0.0;         ///< σ of the scale by the positions of the target's points, relative.
  std::optional<ImuEstimate> imu;          ///< If one was given.
  bool has_target = false;                 ///< Known points were given,
  bool is_in_map = false;                  ///< as a saved map,
  bool lacks_map_frame = false;            ///< whose file does not state the errors of its frame,
  MovedPoints moved_points;                ///< and some of which have moved since (tables only).
  bool is_of_images = false;
  bool lacks_circle = false;  ///< A circular mask was requested, but no image shows a circle: nothing is masked.
  double still_share = 0.0;   ///< Share of the image with edges that never move while the scene does: masked.
  double sigma_px =
      std::numeric_limits<double>::quiet_NaN();  ///< σ of an observation that states none; for images the least.
  SigmaPxFrom sigma_px_from = SigmaPxFrom::usual;
  std::size_t num_lost = 0;            ///< Frames whose pose no observations constrain: waiting or predicted.
  std::size_t num_repeated = 0;        ///< Lost frames that repeat the last one while the camera moves.
  std::vector<MissingFrames> missing;  ///< Times counted from frame to frame are wrong at these gaps.
  std::vector<int> frame_pattern;      ///< Periods from frame to frame, repeating, if `missing` has a pattern.
  std::size_t num_restarts = 0;
  std::size_t num_left = 0;                           ///< Times that a point was removed from a full filter.
  std::size_t num_loops = 0, num_loops_rejected = 0;  ///< Accepted and rejected loop closures.
  std::size_t num_observations = 0, num_used = 0, num_gated = 0, max_seen = 0;
  std::size_t num_known = 0, num_known_gated = 0;
  double nis_per_dof = std::numeric_limits<double>::quiet_NaN();
  /// Mean squared shift of the target's points in the map from their given positions, over σ², per coordinate.
  double known_shift = std::numeric_limits<double>::quiet_NaN();
  MovedPart moved_part;       ///< Moved group of the target's points (tables only).
  RadialStructure radial;     ///< Radial structure of the residuals after the update: reveals a wrong lens.
  std::size_t num_alike = 1;  ///< Candidates for the target in one image, if initialisation failed because of them.
  Camera camera;              ///< The camera as used at the end.
  std::vector<std::string> lens_params;  ///< The camera's parameters that were estimated,
  Eigen::VectorXd sigma_lens;            ///< and their σ.
  std::optional<Camera> given_camera;    ///< If the observations contradict it: the lens was estimated without it.
  std::vector<TimedPose> truth;          ///< The truth as given.
  PathError error;                       ///< If there is truth.
  bool is_scale_given = true;            ///< As in LocalizeTarget; also true if the config has its σ.
  bool is_board = false;                 ///< The target is a printed board, visible from one side.
  bool is_behind = false;                ///< Most poses lie behind the flat target, where it is not visible.
  ResidualStructure residuals;           ///< Structure of the residuals of a smoothed path.
  bool is_smoothed = false;         ///< Path and map are from all observations jointly, not from earlier ones only.
  std::size_t smoothed_every = 1;   ///< One of so many frames was solved for, the others follow: long recordings.
  std::size_t num_unexplained = 0;  ///< Frames of a smoothed path whose observations mostly do not fit it.
  std::size_t num_untied = 0;       ///< Reinitialisations with few points in common before and after.
  /// For a smoothed path: the factor by which σ is enlarged along the least certain direction, where the cost rises
  /// more slowly on one side than on the other, or more slowly than σ says.
  double widened = 1.0;
  /// For a smoothed path: the camera hardly translates, and errors may exceed σ in the least certain components.
  bool is_from_one_place = false;
  std::vector<GivenNumber> given;  ///< What was given, and its effect on the path.
  double lens_pull = 0.0;          ///< For an estimated lens: largest change from a given value, in its given σ.

  Counts counts;  ///< Counts of frames, and rejected rows.
  std::vector<Assumption> assumed;
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
