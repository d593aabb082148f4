#pragma once

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/matching/matched_photos.h"
#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/pantilt/rotation_log.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Something that happened to the intrinsics or the points.
struct ObserveNote {
  double t_s = 0.0;
  ObserveEvent event = ObserveEvent::none;
  int point = -1;  ///< From 0; −1: of all.
};

/// How the camera rotated, about its own axes. [rad]
struct ObserveMotion {
  Eigen::Vector3d path_rad = Eigen::Vector3d::Zero();  ///< ∫|ω_x|, ∫|ω_y|, ∫|ω_z|.
  double span_rad = 0.0;                               ///< Largest rotation away from the first row.
};

/// One value with σ and the Cramér–Rao bound of this very log. σ counts errors that residuals share and what is given
/// with a σ; sigma_model: with independent pixel errors.
struct ObservedQuantity {
  std::string name;
  double value = 0.0, sigma = 0.0, bound = 0.0, sigma_model = 0.0;
};

/// A pixel of the adjustment that the bound is of, and its residual: prediction minus pixel.
struct ObserveResidual {
  int row = 0;     ///< Of the log.
  int point = -1;  ///< Of the log, from 0.
  Eigen::Vector2d px = Eigen::Vector2d::Zero(), residual_px = Eigen::Vector2d::Zero();
};

/// Something taken as exact, and whether the residuals indicate it: z is the improvement as a normal deviate.
struct TestedCause {
  struct Value {
    std::string name, unit;
    double value = 0.0, sigma = 0.0;  ///< What the residuals indicate.
  };
  std::string name;
  double z = 0.0;
  std::vector<Value> values = {};
};

/// Why σ is larger than it would be with independent pixel errors.
struct SharedErrors {
  double design_effect = 1.0;                 ///< Variance between blocks of time (photos) over the model's.
  double correlation_s = 0.0, block_s = 0.0;  ///< How long errors of a track last; length of a block.
  double track_effect = 1.0;                  ///< Variance of the tracks' scores over what lasts in them.
  double rotation_rad = 0.0;  ///< σ of what the pixels of a frame have in common, as of its rotation; 0: no more than
                              ///< by chance.
};

/// What became of a photo of a camera that rotated on the spot.
struct RotatedPhoto {
  bool is_used = false;
  std::string reason;  ///< Why it was rejected.
  int num_points = 0;
  double rms_px = 0.0;                  ///< Per point.
  double turn_rad = 0.0;                ///< Rotation from the first photo that is used.
  double z2 = 0.0;                      ///< Squared change of the estimate without it, over its expectation.
  double zoom = 1.0, sigma_zoom = 0.0;  ///< Its focal length over the others', if it may have one of its own.
  Eigen::Matrix3d cam_from_world = Eigen::Matrix3d::Identity();
};

/// How much the camera's centre moved, by the residuals along the epipolar lines less those across them.
struct ParallaxTest {
  double z = 0.0;  ///< Of the pair that shows it most.
  int photo_a = -1, photo_b = -1;
  double rms_px = 0.0;    ///< Of all pairs.
  double relative = 0.0;  ///< Over the points' distance, a radian of rotation.
};

/// Matches between photos.
struct MatchCounts {
  std::size_t given = 0;      ///< Between photos that take part.
  std::size_t agreeing = 0;   ///< With one homography a pair.
  std::size_t kept = 0;       ///< With one camera.
  std::size_t burned_in = 0;  ///< Not among these: of what is at one place in the image, a date or a logo.
};

/// The result of observe() on a log or photos: what they determine, and how well. Where there is no
/// estimate, camera, quantities and covariance are empty, and the verdict says why.
struct ObserveReport {
  enum class Status {
    ok,
    too_few_data,
    unobservable,
    focal_length_varies,  ///< The focal length changes all the time, and the method needs a constant one.
    no_convergence
  };
  Status status = Status::too_few_data;
  Verdict verdict;
  Counts counts;  ///< Of rows, or photos.
  std::vector<Assumption> assumed;

  int width_px = 0, height_px = 0;  ///< Of the images.
  bool size_is_guessed = false;     ///< Not given: the smallest size that contains the pixels.
  Camera camera;                    ///< At the end of the log, with its covariance.
  /// fx, fy, cx, cy [px], then what else was estimated: k1, …, mount_x_rad…, delay_s, lever_x_m….
  std::vector<ObservedQuantity> quantities;
  Eigen::MatrixXd covariance;  ///< Of the quantities, in their order and units.

  RotationLog log;  ///< As used: without the distortion of a lens that is given. Photos: a row each.
  std::vector<IntrinsicsEstimate> steps;  ///< One per row.
  std::vector<ObserveNote> events;
  double sigma_px = 0.0;           ///< Of a pixel coordinate.
  bool sigma_is_estimated = true;  ///< From the residuals.
  double nis_per_dof = 0.0;
  ObserveMotion motion;
  /// The longest time in which the intrinsics did not change: the bound and the residuals are of its rows.
  double reference_from_s = 0.0, reference_until_s = std::numeric_limits<double>::infinity();
  std::vector<ObserveResidual> residuals;
  std::vector<TestedCause> tested_causes;
  SharedErrors shared_errors;
  /// How the rotation of each row was taken: σ of measured angles, or of rates. 0: exact; infinite: not measured.
  double sigma_angle_rad = 0.0, sigma_rate_rad_per_s = 0.0;

  std::vector<RotatedPhoto> photos;  ///< One per photo; empty of a log. This and what follows is of photos.
  std::vector<std::string> photo_names;
  MatchCounts matches;
  ParallaxTest parallax;
  std::optional<MatchedPhotos> found_matches;  ///< Where they were not given.
  std::size_t num_unreadable = 0;
};

/// The pixels tell next to nothing of it, though of fx: value and σ are mostly what was assumed.
[[nodiscard]] inline bool is_assumed(const ObserveReport& report, const ObservedQuantity& quantity) {
  constexpr double mostly = 2.0;  // the bound counts no assumption
  return std::isfinite(report.quantities.front().bound) && !(quantity.bound < mostly * quantity.sigma_model);
}

/// The word for an event in files: start, burst, slip, zoom, zoom_end, restart, gap; empty for none.
[[nodiscard]] std::string_view event_name(ObserveEvent event);

ALIDADE_PUBLIC_END
}  // namespace alidade
