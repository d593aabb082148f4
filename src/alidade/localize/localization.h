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
  waiting,  ///< Not started yet: no pose.
  started,
  tracked,
  predicted,  ///< Fewer than three points used: the pose is mostly the motion's.
  restarted,
};
[[nodiscard]] std::string_view event_name(FrameEvent event);

/// Where σ of a pixel comes from.
enum class SigmaPxFrom {
  usual,      ///< Nobody gave it, and the observations do not deny it.
  given,      ///< By the config.
  rows,       ///< Each observation states its own.
  residuals,  ///< Estimated.
};
[[nodiscard]] std::string_view source_name(SigmaPxFrom from);

/// A frame of the path.
struct PathStep {
  long frame = 0;
  double t_s = 0.0;
  FrameEvent event = FrameEvent::waiting;
  Rigid3 world_from_cam;
  Eigen::Matrix<double, 6, 6> cov =
      Eigen::Matrix<double, 6, 6>::Zero();  ///< Of the right perturbation: translation [m], rotation [rad].
  std::size_t num_seen = 0, num_tracked = 0, num_gated = 0, num_features = 0;
  std::size_t num_known = 0, num_known_gated = 0;  ///< Of those used or gated: the target's.
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
  /// Without what the errors of all points have in common (saved_map.frame). None: not known apart.
  std::optional<Eigen::Matrix3d> cov_in_map = {};
};

/// A parameter taken as given: how an error of it would move the path, and its score test (Lagrange multiplier test):
/// the value that it would take were it estimated too, by the linearisation at the solution.
struct GivenNumber {
  /// "focal length", "centre u", "centre v", "k1", "scale of the target", "shape of the target", "speed of the target",
  /// "rotation of the target", "readout" (of a rolling shutter, first row to last), "clock"
  std::string_view name;
  double moves = 0.0;           ///< Largest move of a pose's number for a whole unit (relative, px, m/s, s), in its σ,
  std::string_view moved = {};  ///< which that is,
  double moved_by = 0.0;        ///< and by how much [m or rad].
  double asked = 0.0, z = 0.0;  ///< The change that the score test indicates, in units, and over its σ.
  std::optional<double> sigma;  ///< Counted, in units. None: not known.
  /// Of the focal length, and before a target of the centre: an error of up to this the score would not show, and σ of
  /// the path has so much of it that it moves no pose by more than 4σ; of a centre about which next to nothing is seen
  /// also no combination of a pose's numbers.
  double hidden = 0.0, sigma_hidden = 0.0;
};

/// The scale of the path by another sensor.
struct SensorScale {
  std::string sensor;      ///< "depth sensor", "rangefinder", "odometry", "IMU"
  double scale = 1.0;      ///< Metres per unit of the path without it: 1 where a target gave correct metres.
  double sigma_rel = 0.0;  ///< Of the scale, over it. 0: the readings do not determine it.
  std::size_t num_used = 0, num_rejected = 0;
  bool is_in_time = true;  ///< There are readings within the time span of the path.
  double late_s = 0.0;     ///< The readings' clock less the camera's, where it is off: corrected.
  double offset_m = 0.0;   ///< By which a rangefinder's readings are too long, where they are: corrected.
  double aside_rad = 0.0;  ///< By which a rangefinder's beam points elsewhere than given, where it does: corrected.
  /// Share of the scale that an offset of 0.1 m of a rangefinder's readings would be, where it would not show; else 0.
  double hidden_offset_rel = 0.0;
  double lag_s = 0.0;                 ///< Time constant of the filter of a depth sensor or odometry, if any: corrected.
  double acceleration = 0.0;          ///< RMS of the camera's by this scale, over the one that is given.
  double jump_m = 0.0, jump_s = 0.0;  ///< By which a depth sensor reads more from a time on, where it does: corrected.
  /// Log of another scale over this one, that a rangefinder's readings have as well, of another surface; else 0.
  double other_log_scale = 0.0;
  bool is_drifting = false;
  double drift_m = 0.0;  ///< By which a depth sensor reads more at the end than at first, where it drifts: corrected.
  /// Where a depth sensor is in the camera's frame, and σ, where it is not where it was said to be; else 0.
  Eigen::Vector3d arm_m = Eigen::Vector3d::Zero(), sigma_arm_m = Eigen::Vector3d::Zero();
  double arm_given_m = 0.0;  ///< How far from the camera it was said to be.
  double arm_effect = 0.0;   ///< Change of ln scale for 1 cm of that, where it has no σ.
  /// When odometry's wheels slip most, and its way over the path's there: left out. 0: they do not.
  double slip_from_s = 0.0, slip_to_s = 0.0, slip_ratio = 0.0;
  std::string unit;  ///< Of the readings, where a target shows that they are not in metres: "cm". Taken as such.
  bool is_too_fast = false;   ///< By it the camera would accelerate so much that it is not used.
  double noise_factor = 1.0;  ///< RMS of what is left of a depth sensor's readings, over their σ.
};

/// Mean radial residual in rings about the principal point.
struct RadialStructure {
  double share = 0.0;          ///< RMS over the rings of the mean residual over σ: 0 for a right lens.
  double chi2_per_ring = 0.0;  ///< Squares of these means over their own σ, were observations independent.
  double worst_px = 0.0;       ///< The largest mean residual.
};

/// Dependence between residuals that should be independent.
struct ResidualStructure {
  double autocorrelation = 0.0;        ///< Correlation of a point's residual with that of the frame before.
  double sigma_autocorrelation = 1.0;  ///< Of that, were they independent.
  /// Whether that is significant and large enough to matter.
  [[nodiscard]] bool is_autocorrelated() const {
    return autocorrelation > 0.25 && autocorrelation > 4.0 * sigma_autocorrelation;
  }
  double mean_chi2 = 0.0;  ///< Of the mean residuals of 4 × 3 parts of the image, over their count: 1 where right.
  double mean_chi2_limit = 1e9;  ///< 99.9 % of that.
  double worst_px = 0.0;         ///< The largest mean,
  std::string worst_region;      ///< and where: "upper left".
};

/// Frames of a constant rate that seem to be missing before one of the path, though its time says that none is.
struct MissingFrames {
  std::size_t before = 0;  ///< Index in the path.
  int num = 0;
};

/// Of the points of a map that an earlier run has left: those that are no longer where it has them. They are new points
/// of the path's map.
struct MovedPoints {
  std::size_t num = 0, num_judged = 0;  ///< Of those that could be judged.
  std::size_t num_as_one = 0;           ///< Of those that moved, so many moved together.
  double median_m = 0.0;                ///< How far; 0: not known.
  bool is_left_out = true;              ///< The path is by the others alone.
};

/// Of the points of a target, where their own σ leaves little of a part's mean: those that are elsewhere than given
/// against the others.
struct MovedPart {
  std::size_t num = 0, num_given = 0;  ///< Of so many that are in the map; 0: too few to say.
  double shift_m = 0.0, chi2 = 0.0;    ///< Of the shift, of three numbers, that explains most.
  double spread = 0.0;                 ///< Of all, along one direction, squares over σ²: 1 where right,
  double spread_limit = 1e9;           ///< and 99.9 % of that.
};

/// How far an estimated path is from the true one. Sturm et al., "A Benchmark for the Evaluation of RGB-D SLAM
/// Systems", IROS 2012: ATE is the RMS distance of positions after alignment; RPE the RMS translation of
/// (Q_i⁻¹ Q_i+1)⁻¹ (P_i⁻¹ P_i+1) between neighbours, with the aligned scale.
struct PathError {
  double ate_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_m = std::numeric_limits<double>::quiet_NaN();
  double rpe_rad = std::numeric_limits<double>::quiet_NaN();  ///< RMS rotation of the same.
  double unaligned_m = std::numeric_limits<double>::quiet_NaN();
  double scale = 1.0;  ///< Of truth over estimate.
  /// RMS of the positions' stated σ (root of the trace), with the aligned scale: what `ate_m` should not be above, as
  /// an alignment takes errors away and adds none.
  double stated_m = std::numeric_limits<double>::quiet_NaN();
  /// Mean of dᵀ Σ⁻¹ d of the poses as they are, over 6 (Bar-Shalom, eq. 5.4.2-3); NaN where the truth is in another
  /// frame: farther from the path than 10 σ and a tenth of its size, or turned by more than 0.2 rad.
  double nees_per_dof = std::numeric_limits<double>::quiet_NaN();
  /// The same of the aligned positions, over 3. Σ is that in the path's frame, and errors that all frames share are
  /// aligned away: far below 1 is no fault, above 1 is one.
  double nees_aligned_per_dof = std::numeric_limits<double>::quiet_NaN();
  std::size_t num_pairs = 0;
};

/// The result of localize(): the path, the map, and the verdict.
struct Localization {
  std::vector<PathStep> path;  ///< One per frame.
  std::vector<MapPoint> map;   ///< At the end.
  SavedMap saved_map;          ///< The same for another run to begin in: points whose position is known well enough.
  bool scale_known = false;
  bool is_scale_read = false;              ///< Known by `sensor_scales`, and not by a target.
  std::vector<SensorScale> sensor_scales;  ///< Of what readings there were.
  double sigma_target_scale = 0.0;         ///< Of the scale by where the target's points are, relative.
  std::optional<ImuEstimate> imu;          ///< Where one was given.
  bool has_target = false;                 ///< Known points were given,
  bool is_in_map = false;                  ///< as a map that was saved,
  bool lacks_map_frame = false;            ///< whose file has nothing about the errors of its frame,
  MovedPoints moved_points;                ///< and of which some moved since, of tables.
  bool is_of_images = false;
  bool lacks_circle = false;  ///< A circle was to be masked around, and no image shows one: nothing is masked.
  double still_share = 0.0;   ///< Of the image, edges that never move while the scene does: masked.
  double sigma_px =
      std::numeric_limits<double>::quiet_NaN();  ///< Of an observation that brings none; of images the least.
  SigmaPxFrom sigma_px_from = SigmaPxFrom::usual;
  std::size_t num_lost = 0;            ///< Frames whose pose observations do not constrain: waiting or predicted.
  std::size_t num_repeated = 0;        ///< Of these, those that showed the last one again while the camera moved.
  std::vector<MissingFrames> missing;  ///< Times that are numbered through them are wrong.
  std::vector<int> frame_pattern;      ///< Periods from frame to frame, again and again, where `missing` has a pattern.
  std::size_t num_restarts = 0;
  std::size_t num_left = 0;                           ///< Times that a point was removed from a full filter.
  std::size_t num_loops = 0, num_loops_rejected = 0;  ///< Loop closures; of these rejected.
  std::size_t num_observations = 0, num_used = 0, num_gated = 0, max_seen = 0;
  std::size_t num_known = 0, num_known_gated = 0;
  double nis_per_dof = std::numeric_limits<double>::quiet_NaN();
  /// How far the target's points have gone in the map from their given positions: squares over σ², per number.
  double known_shift = std::numeric_limits<double>::quiet_NaN();
  MovedPart moved_part;       ///< Of a table's target.
  RadialStructure radial;     ///< Of the residuals after the update: shows a wrong lens.
  std::size_t num_alike = 1;  ///< Candidates for the target in one image, where initialisation failed because of them.
  Camera camera;              ///< As it is at the end.
  std::vector<std::string> lens_params;  ///< Of the camera's parameters those that were estimated,
  Eigen::VectorXd sigma_lens;            ///< and their σ.
  std::optional<Camera> given_camera;    ///< Where the observations contradict it: estimated without it, with the path.
  std::vector<TimedPose> truth;          ///< As given.
  PathError error;                       ///< With truth.
  bool is_scale_given = true;            ///< As in LocalizeTarget; also where the config has its σ.
  bool is_board = false;                 ///< The target is a printed board, which has one side.
  bool is_behind = false;                ///< Most poses are behind the flat target, where it is not visible.
  ResidualStructure residuals;           ///< Of a smoothed path.
  bool is_smoothed = false;         ///< Path and map are from all observations together, not each from those before it.
  std::size_t smoothed_every = 1;   ///< Of so many frames one was solved for, those between follow: a long recording.
  std::size_t num_unexplained = 0;  ///< Frames of a smoothed path of which most observations do not fit it.
  std::size_t num_untied = 0;       ///< Reinitialisations on both sides of which few points are the same there.
  /// Of a smoothed path: along its least certain direction the cost rises more slowly to one side than to the other, or
  /// than σ says; σ is enlarged there by so much.
  double widened = 1.0;
  /// Of a smoothed path: the camera hardly moves aside, and its least certain components are less sure than their σ.
  bool is_from_one_place = false;
  std::vector<GivenNumber> given;  ///< What was given, and its effect on the path.
  double lens_pull = 0.0;          ///< Of a lens that was estimated: how far from what was given, in the given σ.

  Counts counts;  ///< Of frames, and rows that were rejected.
  std::vector<Assumption> assumed;
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
