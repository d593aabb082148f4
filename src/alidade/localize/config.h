#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/beam/beam.h"
#include "alidade/description/field.h"
#include "alidade/imu/imu.h"
#include "alidade/localize/camera_motion.h"
#include "alidade/localize/distortion.h"
#include "alidade/localize/saved_map.h"
#include "alidade/localize/sequence.h"
#include "alidade/localize/target.h"
#include "alidade/public.h"

namespace alidade {
class LocalizationFilter;
ALIDADE_PUBLIC_BEGIN
struct PathStep;

/// The filter: an error-state EKF over motion, lens and map.
struct LocalizationFilterConfig {
  double sigma_px = 0.5;  ///< Of a pixel coordinate, where an observation does not say.
  /// Of the pixel by which a new feature is defined; 0: sigma_px. A patch that is looked for as it was first seen is
  /// there by definition.
  double sigma_new_px = 0.0;
  double sigma_a_m_s2 = 1.0;          ///< Acceleration between predictions; a hand's is about 4.
  double sigma_alpha_rad_s2 = 1.5;    ///< Angular acceleration; a hand's is about 6.
  int max_iterations = 4;             ///< Gauss–Newton steps of an update.
  double gate = 13.8;                 ///< χ² of two components: 99.9 %.
  double curvature_tolerance = 0.05;  ///< Iterate while the nonlinearity of an innovation exceeds so many σ.
  bool is_sequential = true;          ///< Known points first, then by growing innovation; false: in the order given.
  bool finds_consensus = true;        ///< One-point consensus where observations disagree: mismatches.
  double consensus_above = 0.0;       ///< Share of the observations that may disagree before a consensus is looked for.
  /// The world's rotation and scale are unobservable, and the covariance is kept consistent with that:
  /// world_rotation.h, world_scale.h. False: a plain EKF, which wrongly gains information (Julier & Uhlmann, 2001).
  bool holds_frame = true;
  /// Above this rotation of an update the errors are not those that rotate with the world, which are linear for small
  /// rotations only; the frame is then kept by the derivatives alone. See world_rotation.h. [rad]
  double max_rotation_rad = 0.02;
  double linear_below = 0.1;          ///< Linearity index below which an inverse depth becomes a position.
  std::vector<int> lens_params = {};  ///< Indices of the lens's parameters that are in the state, and their initial σ.
  std::vector<double> sigma_lens_params = {};
  double sigma_scale = 0.0;  ///< Of the known points' shared scale, relative; counted, as the lens's covariance is.
  int state_capacity = 800;  ///< Components of the state at most.
  int observations_capacity = 200;  ///< Measured features of one moment at most.
};

/// A Gaussian sum of filters with different initial speeds, until the observations decide.
struct FilterBankConfig {
  int splits = 5;            ///< Parts of the speed aside, to each of two sides; 1: none.
  double spread = 1.5;       ///< The outermost part, in σ.
  double narrowed = 0.5;     ///< σ of a part over the σ of the whole.
  double min_weight = 40.0;  ///< A part whose −2 ln likelihood exceeds the best one's by so much is dropped.
  int max_frames = 15;       ///< After so many updates only the best one is kept.
};

/// How features of images are selected, tracked and dropped.
struct ImageFeatureConfig {
  int min_found = 30;  ///< New ones are added while fewer are found in an image.
  int max_tried = 40;  ///< Looked for in an image, the oldest first: they drift least.
  int max_new = 8;     ///< In an image, after the first.
  int max_features = 120;
  /// Least σ of a match's coordinate: what patches of things with depth, seen through a lens that is not quite as
  /// calibrated, are off by, however well they fit.
  double sigma_floor_px = 0.11;
  double min_correlation = 0.8;
  double min_found_share = 0.5;  ///< Features that are found less often leave.
  int cell_px = 0;               ///< Of the grid on which new ones are chosen; 0: a tenth of the image's width.
  double near_share = 0.15;      ///< Distance between keyframes over that of the map's points,
  double near_rad = 0.15;        ///< and angle.
};

/// Prior of a point's depth along the optical axis of the camera that first sees it.
struct GivenDepth {
  long id = 0;
  double depth_m = 1.0;
  double sigma_rel = 0.03;
};

/// What is known before the first frame.
struct LocalizeStart {
  CameraMotion motion = {};
  MotionMatrix cov = MotionMatrix::Zero();
  double depth_m = 0.0;      ///< Of new points, where the config does not say; 0: not known.
  double sigma_depth = 0.5;  ///< Of that, relative.
  std::vector<GivenDepth> depths = {};
};

/// Mask of the image area that shows the scene: no features elsewhere.
struct ImageMask {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> shows = {};  ///< Row by row; 0: not.
};

/// How deep a camera is, up to an offset: from a pressure sensor.
struct DepthReading {
  double t_s = 0.0, depth_m = 0.0, sigma_m = 0.01;
};

/// What a rangefinder beside the camera reads.
struct RangeReading {
  double t_s = 0.0, range_m = 0.0;
};

/// Where a vehicle's odometry says that it is, in a frame of its own that drifts.
struct OdometryReading {
  double t_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};

/// When a new point enters the state.
enum class NewPoints {
  inverse_depth,  ///< With its first observation, as an inverse depth.
  xyz,            ///< With its first observation, as a position.
  delayed,        ///< When two of its observations give its depth to 5 %, as an inverse depth.
};

/// Options of localize(). Plain data with usable defaults.
struct LocalizeConfig {
  DistortionVariant distortion = DistortionVariant::full;
  bool calibrate_online = false;  ///< fx fy cx cy k1 k2 p1 p2 are estimated, as far as the lens has them.
  NewPoints new_points = NewPoints::inverse_depth;
  std::optional<double> depth_m = {};  ///< Of new points of which no depth is given. None: the target's distance.
  double sigma_depth = 0.5;            ///< Of those, relative.
  /// Of a pixel coordinate; in images the least of a match. None: of a table estimated, 0.5 where nothing denies it;
  /// 0.11 in images.
  std::optional<double> sigma_px = {};
  std::optional<double> sigma_scale = {};    ///< Of the target's size, relative: counted. None: the target's own.
  std::optional<double> sigma_times_s = {};  ///< Of the frames' times, all alike. 0: exact. None: by an IMU's clock.
  std::optional<LocalizeStart> start = {};   ///< Else from the target, else the first camera is the world, up to scale.
  LocalizeTarget target = {};
  std::optional<SavedMap> map = {};  ///< Of an earlier run, to begin in, instead of a target; its frame is the path's.
  std::vector<DepthReading> depth_readings = {};  ///< In order of time: scale without a target, else a check of it.
  /// Where the depth sensor is in the camera's frame; none: at its centre. σ of each coordinate: counted.
  std::optional<Eigen::Vector3d> depth_arm_m = {};
  std::optional<double> sigma_depth_arm_m = {};
  double sigma_depth_sensor = 0.01;  ///< Of the depths' scale, relative: fresh and sea water differ by 0.026.
  std::vector<RangeReading> range_readings = {};  ///< The same, of `beam`.
  std::optional<Beam> beam = {};
  std::vector<OdometryReading> odometry_readings = {};  ///< The same, by the lengths travelled.
  double sigma_odometry = 0.01;  ///< Of a length, relative: what all of them share, as a wheel's radius.
  std::optional<Imu> imu = {};   ///< Scale without a target, else a check of it; used by the smoothed path.
  std::optional<ImageMask> mask = {};
  bool masks_circle = false;  ///< Images show the scene in a circle, as an endoscope's: found in the first that does.
  bool masks_still = false;   ///< What never moves while the scene does is detected and masked.
  double period_s = 0.0;      ///< Usual time between frames. 0: the median so far; of images the least.
  bool smooths = true;        ///< With a target: the path is solved again from all observations after the last frame.
  int max_smoothed = 8000;  ///< Frames solved together: of a longer path every second, fourth, …; the others follow.
  bool restarts = true;     ///< From the target where the innovations say that the path is wrong.
  int max_points = 0;       ///< In the filter at once, beside the target's; 0: as many as its state holds.
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;  ///< At a start from the target or from nothing.
  LocalizationFilterConfig filter = {};
  FilterBankConfig bank = {};
  ImageFeatureConfig features = {};

  std::function<double()> seconds = {};             ///< A clock [s], if the time per frame is to be measured.
  std::function<void(const PathStep&)> watch = {};  ///< Called with each step; what it throws ends the work.
  /// Called with each image and the features searched for in it, before `watch` with its step.
  std::function<void(double t_s, const cv::Mat&, std::span<const ObservationTried>)> watch_image = {};
  /// For studies. Is given what was matched in an image before the filter sees it, and may change it;
  std::function<void(long frame, std::vector<FeatureObservation>&)> disturb = {};
  /// is shown the filter after each frame of observations that has one.
  std::function<void(const LocalizationFilter&)> inspect = {};
};

/// The fields of `config` that a person sets: distortion, calibrate_online, new_points, depth_m, sigma_depth, sigma_px,
/// sigma_scale, sigma_a_m_s2, sigma_alpha_rad_s2 and max_points. Start and target are values that come from files.
[[nodiscard]] FieldList fields_of(LocalizeConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
