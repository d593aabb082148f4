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

/// A detected event in the intrinsics or the points.
struct ObserveNote {
  double t_s = 0.0;
  ObserveEvent event = ObserveEvent::none;
  int point = -1;  ///< Counted from 0; −1: all points.
};

/// Rotation of the camera about its own axes. [rad]
struct ObserveMotion {
  Eigen::Vector3d path_rad = Eigen::Vector3d::Zero();  ///< ∫|ω_x|, ∫|ω_y|, ∫|ω_z|.
  double span_rad = 0.0;                               ///< Largest rotation from the first row.
};

/// A value with its σ and its Cramér–Rao bound for this log. `sigma` includes errors that residuals share and given
/// values with their σ; `sigma_model` assumes independent pixel errors.
struct ObservedQuantity {
  std::string name;
  double value = 0.0, sigma = 0.0, bound = 0.0, sigma_model = 0.0;
};

/// A pixel of the bundle adjustment on which the bound is based, and its residual: prediction minus pixel.
struct ObserveResidual {
  int row = 0;     ///< Index in the log.
  int point = -1;  ///< Index in the log, from 0.
  Eigen::Vector2d px = Eigen::Vector2d::Zero(), residual_px = Eigen::Vector2d::Zero();
};

/// Something taken as exact, and whether the residuals indicate it: z is the improvement as a normal deviate.
struct TestedCause {
  struct Value {
    std::string name, unit;
    double value = 0.0, sigma = 0.0;  ///< Indicated by the residuals.
  };
  std::string name;
  double z = 0.0;
  std::vector<Value> values = {};
};

/// Why σ is larger than for independent pixel errors.
struct SharedErrors {
  double design_effect = 1.0;                 ///< Variance between blocks of time (photos) over the model's.
  double correlation_s = 0.0, block_s = 0.0;  ///< Time constant of errors along a track; length of a block.
  double track_effect = 1.0;                  ///< Variance of the tracks' scores over that of the lasting errors.
  double rotation_rad = 0.0;  ///< σ of an error that all pixels of a frame share, as a rotation of the frame; 0: no
                              ///< more than by chance.
};

/// Result for one photo of a camera that rotated about its centre.
struct RotatedPhoto {
  bool is_used = false;
  std::string reason;  ///< Why the photo was rejected.
  int num_points = 0;
  double rms_px = 0.0;                  ///< Per point.
  double turn_rad = 0.0;                ///< Rotation from the first photo used.
  double z2 = 0.0;                      ///< Squared change of the estimate without this photo, over its expectation.
  double zoom = 1.0, sigma_zoom = 0.0;  ///< Focal length over that of the others, if the photo may have its own.
  Eigen::Matrix3d cam_from_world = Eigen::Matrix3d::Identity();
};

/// Test for translation of the camera's centre: residuals along the epipolar lines minus those across them.
struct ParallaxTest {
  double z = 0.0;  ///< Score for the pair of photos with the largest z.
  int photo_a = -1, photo_b = -1;
  double rms_px = 0.0;    ///< RMS over all pairs.
  double relative = 0.0;  ///< Translation over the points' distance, per radian of rotation.
};

/// Numbers of matches between photos.
struct MatchCounts {
  std::size_t given = 0;      ///< Matches between photos that are used.
  std::size_t agreeing = 0;   ///< Matches consistent with one homography per pair.
  std::size_t kept = 0;       ///< Matches consistent with one camera.
  std::size_t burned_in = 0;  ///< Not counted above: matches of what is fixed in the image, a date or a logo.
};

/// The result of observe() on a log or photos: the intrinsics that they determine, and their uncertainty. If there is
/// no estimate, camera, quantities and covariance are empty, and the verdict says why.
struct ObserveReport {
  enum class Status {
    ok,
    too_few_data,
    unobservable,
    focal_length_varies,  ///< The focal length changes continuously, and the method needs a constant one.
    no_convergence
  };
  Status status = Status::too_few_data;
  Verdict verdict;
  Counts counts;  ///< Counts of rows, or of photos.
  std::vector<Assumption> assumed;

  int width_px = 0, height_px = 0;  ///< Size of the images.
  bool size_is_guessed = false;     ///< No size was given: the smallest that contains all pixels.
  Camera camera;                    ///< The camera at the end of the log, with its covariance.
  /// fx, fy, cx, cy [px], then what else was estimated: k1, …, mount_x_rad…, delay_s, lever_x_m….
  std::vector<ObservedQuantity> quantities;
  Eigen::MatrixXd covariance;  ///< Covariance of the quantities, in their order and units.

  RotationLog log;                        ///< Log as used: undistorted if a lens is given. For photos, one row each.
  std::vector<IntrinsicsEstimate> steps;  ///< One per row.
  std::vector<ObserveNote> events;
  double sigma_px = 0.0;           ///< σ of a pixel coordinate.
  bool sigma_is_estimated = true;  ///< Estimated from the residuals, not given.
  double nis_per_dof = 0.0;
  ObserveMotion motion;
  /// Longest interval with constant intrinsics: bound and residuals refer to its rows.
  double reference_from_s = 0.0, reference_until_s = std::numeric_limits<double>::infinity();
  std::vector<ObserveResidual> residuals;
  std::vector<TestedCause> tested_causes;
  SharedErrors shared_errors;
  /// σ assumed for each row's rotation: for measured angles, or for rates. 0: exact; infinite: not measured.
  double sigma_angle_rad = 0.0, sigma_rate_rad_per_s = 0.0;

  std::vector<RotatedPhoto> photos;  ///< One per photo; empty for a log. The members below are for photos only.
  std::vector<std::string> photo_names;
  MatchCounts matches;
  ParallaxTest parallax;
  std::optional<MatchedPhotos> found_matches;  ///< Unless the matches were given.
  std::size_t num_unreadable = 0;
};

/// The pixels hardly determine this quantity, though they determine fx: value and σ are mostly assumptions.
[[nodiscard]] inline bool is_assumed(const ObserveReport& report, const ObservedQuantity& quantity) {
  constexpr double mostly = 2.0;  // the bound counts no assumption
  return std::isfinite(report.quantities.front().bound) && !(quantity.bound < mostly * quantity.sigma_model);
}

/// The word for an event in files: start, burst, slip, zoom, zoom_end, restart, gap; empty for none.
[[nodiscard]] std::string_view event_name(ObserveEvent event);

ALIDADE_PUBLIC_END
}  // namespace alidade
