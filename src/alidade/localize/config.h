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
  double sigma_px = 0.5;  ///< σ of a pixel coordinate, where an observation states none.
  /// σ of the pixel at which a new feature is initialised [px]; 0: sigma_px. It may be smaller, because a patch that is
  /// matched as it was first seen lies at that pixel by definition.
  double sigma_new_px = 0.0;
  double sigma_a_m_s2 = 1.0;          ///< σ of the acceleration between predictions; hand-held about 4.
  double sigma_alpha_rad_s2 = 1.5;    ///< σ of the angular acceleration; hand-held about 6.
  int max_iterations = 4;             ///< Gauss–Newton steps per update, at most.
  double gate = 13.8;                 ///< χ² with 2 degrees of freedom: 99.9 %.
  double curvature_tolerance = 0.05;  ///< Iterate while the nonlinearity of an innovation exceeds this many σ.
  bool is_sequential = true;          ///< Known points first, then by increasing innovation; false: in the order given.
  bool finds_consensus = true;        ///< One-point consensus where observations disagree: rejects mismatches.
  double consensus_above = 0.0;       ///< Seek a consensus where a larger share of the observations disagrees.
  /// The world's rotation and scale are unobservable, and the covariance is kept consistent with that
  /// (world_rotation.h, world_scale.h). False: a plain EKF, which gains spurious information (Julier & Uhlmann, 2001).
  bool holds_frame = true;
  /// Largest rotation of an update for which errors are taken to rotate with the world, which is linear for small
  /// rotations only; above it the frame is kept by the derivatives alone. See world_rotation.h. [rad]
  double max_rotation_rad = 0.02;
  double linear_below = 0.1;          ///< Linearity index below which an inverse depth is converted to x, y, z.
  std::vector<int> lens_params = {};  ///< Indices of the lens parameters in the state; next, their initial σ.
  std::vector<double> sigma_lens_params = {};
  double sigma_scale = 0.0;  ///< σ of the scale that known points share, relative; included in σ, as the lens's is.
  int state_capacity = 800;  ///< Components of the state, at most.
  int observations_capacity = 200;  ///< Measured features per frame, at most.
};

/// A Gaussian sum of filters that start with different velocities and run until the observations decide between them.
struct FilterBankConfig {
  int splits = 5;            ///< Parts per lateral axis (camera x, y) into which the velocity is split; 1: none.
  double spread = 1.5;       ///< Offset of the outermost part, in σ.
  double narrowed = 0.5;     ///< σ of a part over the σ of the whole.
  double min_weight = 40.0;  ///< A part is dropped if its −2 ln likelihood exceeds the best one's by this much.
  int max_frames = 15;       ///< After this many updates only the best part is kept.
};

/// How image features are selected, tracked and dropped.
struct ImageFeatureConfig {
  int min_found = 30;  ///< New features are added while fewer are found in an image.
  int max_tried = 40;  ///< Features searched for per image, the oldest first: they drift least.
  int max_new = 8;     ///< New features per image, after the first image.
  int max_features = 120;
  /// Least σ of a match's coordinate [px]: the error of patches that match well but show objects with depth, through a
  /// lens that is not quite as calibrated.
  double sigma_floor_px = 0.11;
  double min_correlation = 0.8;
  double min_found_share = 0.5;  ///< Features that are found in a smaller share of the searches are dropped.
  int cell_px = 0;               ///< Cell of the grid on which new ones are selected; 0: a tenth of the image's width.
  double near_share = 0.15;      ///< Spacing of keyframes: distance over that of the map's points,
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
  double depth_m = 0.0;      ///< Depth of new points, where the config gives none; 0: not known.
  double sigma_depth = 0.5;  ///< σ of that depth, relative.
  std::vector<GivenDepth> depths = {};
};

/// Mask of the image area that shows the scene: no features are selected elsewhere.
struct ImageMask {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> shows = {};  ///< Row-major; 0: masked.
};

/// Depth of the camera below the surface, up to a constant offset, by a pressure sensor.
struct DepthReading {
  double t_s = 0.0, depth_m = 0.0, sigma_m = 0.01;
};

/// A reading of a rangefinder mounted beside the camera.
struct RangeReading {
  double t_s = 0.0, range_m = 0.0;
};

/// Position by a vehicle's odometry, in a frame of its own that drifts.
struct OdometryReading {
  double t_s = 0.0;
  Eigen::Vector3d position_m = Eigen::Vector3d::Zero();
};

/// When a new point enters the state.
enum class NewPoints {
  inverse_depth,  ///< On its first observation, as an inverse depth.
  xyz,            ///< On its first observation, as a position.
  delayed,        ///< Once two of its observations determine its depth to 5 %, as an inverse depth.
};

/// Options of localize(). Plain data with usable defaults.
struct LocalizeConfig {
  DistortionVariant distortion = DistortionVariant::full;
  bool calibrate_online = false;  ///< Estimate fx fy cx cy k1 k2 p1 p2, as far as the lens has them.
  NewPoints new_points = NewPoints::inverse_depth;
  std::optional<double> depth_m = {};  ///< Initial depth of new points, where not given. None: the target's distance.
  double sigma_depth = 0.5;            ///< σ of that depth, relative.
  /// σ of a pixel coordinate [px]; for images the least σ of a match. None: for a table estimated, or 0.5 if the
  /// observations do not contradict it; for images 0.11.
  std::optional<double> sigma_px = {};
  std::optional<double> sigma_scale = {};    ///< σ of the target's size, relative: included. None: the target's own.
  std::optional<double> sigma_times_s = {};  ///< σ of the frames' shared time error. 0: exact. None: by an IMU's clock.
  std::optional<LocalizeStart> start = {};   ///< None: by the target, else the first camera is the world, up to scale.
  LocalizeTarget target = {};
  std::optional<SavedMap> map = {};  ///< Map of an earlier run, used instead of a target; the path is in its frame.
  std::vector<DepthReading> depth_readings = {};  ///< In order of time; scale without a target, else a check of it.
  /// Position of the depth sensor in the camera's frame; none: at the camera's centre. σ of each coordinate: included.
  std::optional<Eigen::Vector3d> depth_arm_m = {};
  std::optional<double> sigma_depth_arm_m = {};
  double sigma_depth_sensor = 0.01;  ///< σ of the depths' scale, relative: fresh and sea water differ by 0.026.
  std::vector<RangeReading> range_readings = {};  ///< Likewise, measured along `beam`.
  std::optional<Beam> beam = {};
  std::vector<OdometryReading> odometry_readings = {};  ///< Likewise, by the lengths travelled.
  double sigma_odometry = 0.01;  ///< σ of a length, relative: an error shared by all, as of a wheel's radius.
  std::optional<Imu> imu = {};   ///< Scale without a target, else a check of it; used by the smoothed path.
  std::optional<ImageMask> mask = {};
  bool masks_circle = false;  ///< Images show the scene in a circle (endoscope): found in the first that does.
  bool masks_still = false;   ///< Detect and mask what never moves while the scene does.
  double period_s = 0.0;      ///< Usual time between frames. 0: the median so far; for images the shortest.
  bool smooths = true;        ///< With a target: the path is solved again from all observations after the last frame.
  int max_smoothed = 8000;  ///< Frames solved jointly, at most: of a longer path every 2nd, 4th, …; the rest follow.
  bool restarts = true;     ///< Reinitialise from the target where the innovations show a wrong path.
  int max_points = 0;       ///< Points in the filter at once, without the target's; 0: as many as its state holds.
  double sigma_speed_m_s = 0.3, sigma_rate_rad_s = 0.3;  ///< Initial σ, at a start from the target or from nothing.
  LocalizationFilterConfig filter = {};
  FilterBankConfig bank = {};
  ImageFeatureConfig features = {};

  std::function<double()> seconds = {};             ///< A clock [s], if the time per frame is to be measured.
  std::function<void(const PathStep&)> watch = {};  ///< Called with each step; an exception from it ends the run.
  /// Called with each image and the features searched for in it, before `watch` with the step of that image.
  std::function<void(double t_s, const cv::Mat&, std::span<const ObservationTried>)> watch_image = {};
  /// For studies: called with the matches of an image before the filter uses them; may change them.
  std::function<void(long frame, std::vector<FeatureObservation>&)> disturb = {};
  /// For studies: called with the filter after each frame of observations that has one.
  std::function<void(const LocalizationFilter&)> inspect = {};
};

/// The fields of `config` that a user sets, such as distortion, calibrate_online, new_points, depth_m, sigma_px,
/// sigma_scale, sigma_a_m_s2 and sigma_alpha_rad_s2. Start, target and readings come from files.
[[nodiscard]] FieldList fields_of(LocalizeConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
