#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// hybrid: a bundle adjustment, then a filter that follows zooms. window: an adjustment of the last seconds. flow: a
/// regression on image motion. fang2011: the observer of Fang et al. batch: one adjustment of all rows.
enum class ObserveMethod { hybrid, window, flow, fang2011, batch };

/// What is known of the rotation: exactly as measured, measured with noise, or nothing.
enum class RotationKnowledge { known, noisy, free };

/// Gains of ObserveMethod::fang2011.
enum class FangProfile {
  fast,    ///< Converges within seconds; for noise-free pixels only.
  quiet,   ///< Tolerates a noise of a third of a pixel; converges in twenty seconds.
  kalman,  ///< The same regression with optimal gains.
};

/// Options of observe(). Plain data with usable defaults: `observe(log)` is a sensible call.
struct ObserveConfig {
  ObserveMethod method = ObserveMethod::hybrid;
  RotationKnowledge rotation = RotationKnowledge::known;  ///< For logs; photos and matches have no measured rotation.
  /// Words for what is estimated beside fx, fy, cx, cy: auto (what the residuals indicate), none, or any of k1, k2, k3,
  /// p1, p2, mount, delay, lever, shutter, focal-drift, and for the measured rotation scale, backlash, curve, axes,
  /// drift, bias, clock (its rate relative to the images'). Empty: auto for methods that support it, else none.
  std::vector<std::string> estimate = {};
  /// Initial guess and lens: pixels are undistorted with it unless distortion is estimated.
  std::optional<Camera> camera = {};
  int width_px = 0, height_px = 0;  ///< Image size; 0: the camera's, else the smallest that contains all pixels.
  std::optional<Eigen::Vector4d> start =
      {};  ///< Initial guess of fx, fy, cx, cy [px]; none: from the camera, else from the data.
  FangProfile profile = FangProfile::kalman;
  bool square_pixels = false;                   ///< fx = fy.
  bool no_zoom = false;                         ///< The intrinsics are constant: an apparent zoom has another cause.
  bool fixed_centre = false;                    ///< Fix cx, cy at the initial guess, else at the image's centre.
  std::optional<Eigen::Vector3d> lever_m = {};  ///< Camera centre relative to the centre of rotation, in the camera
                                                ///< frame; fixed, or the initial guess if it is estimated.
  std::optional<double> sigma_px = {};          ///< σ of a pixel coordinate; none: estimated from the residuals.
  std::optional<double> sigma_angle_rad = {};   ///< σ of measured angles and attitudes, if the rotation is noisy.
  std::optional<double> sigma_rate_rad_per_s = {};  ///< σ of measured rates.
  double sigma_range_m = 0.002;
  std::optional<double> sigma_scale = {};     ///< σ of the angle or rate scale, relative; 0: exact; none: the log's.
  std::optional<double> sigma_parallax = {};  ///< σ of the centre's offset along the view, over the points' distance.
  double window_s = 6.0;                      ///< Duration for ObserveMethod::window.
  double max_gap_s = 0.25;  ///< A longer gap in a log of rates starts a segment; in one of angles it gives no rate.
  int keep_rows = 100000;   ///< Rows that an Observer keeps: at least this many, at most twice as many.
};

/// The fields of `config` that a user sets: method, rotation, estimate, start, size, profile, … window_s. The camera is
/// read from a file.
[[nodiscard]] FieldList fields_of(ObserveConfig& config);

/// Throws ConfigError with every fault of a config, in the wording of the command. observe() calls it before any work;
/// a program that reads large files first may call it earlier.
void check_config(const ObserveConfig& config);

/// Width and height of the images according to the config, its own or its camera's [px]; 0, 0: neither is given.
[[nodiscard]] std::pair<int, int> given_size(const ObserveConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
