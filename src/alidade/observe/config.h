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
  fast,    ///< Settles within seconds; for pixels without noise only.
  quiet,   ///< Tolerates noise of a third of a pixel; takes twenty seconds.
  kalman,  ///< The same regression with optimal gains.
};

/// Options of observe(). Plain data with usable defaults: `observe(log)` is a sensible call.
struct ObserveConfig {
  ObserveMethod method = ObserveMethod::hybrid;
  RotationKnowledge rotation = RotationKnowledge::known;  ///< Of logs; photos and matches have no measured rotation.
  /// What is estimated beside fx, fy, cx, cy, by words: auto (what the residuals indicate), none, or of k1, k2, k3, p1,
  /// p2, mount, delay, lever, shutter, focal-drift, and of the measured rotation scale, backlash, curve, axes, drift,
  /// bias, clock (its rate against the images'). Empty: auto of methods that can, else none.
  std::vector<std::string> estimate = {};
  /// An initial guess, and the lens: pixels are undistorted by it where no distortion is estimated.
  std::optional<Camera> camera = {};
  int width_px = 0, height_px = 0;  ///< Of the images; 0: the camera's, else the smallest that contains the pixels.
  std::optional<Eigen::Vector4d> start =
      {};  ///< Initial guess: fx, fy, cx, cy [px]; none: the camera's, or the data's.
  FangProfile profile = FangProfile::kalman;
  bool square_pixels = false;  ///< fx = fy.
  bool no_zoom = false;        ///< The intrinsics are constant: what looks like a zoom has another cause.
  bool fixed_centre = false;   ///< cx, cy: the initial guess's, else the image's centre.
  std::optional<Eigen::Vector3d> lever_m = {};  ///< Camera centre from the centre of rotation, camera frame; known, or
                                                ///< (where it is estimated) the initial guess.
  std::optional<double> sigma_px = {};          ///< Of a pixel coordinate; none: estimated from the residuals.
  std::optional<double> sigma_angle_rad = {};   ///< Of heads and attitudes, where the rotation is noisy.
  std::optional<double> sigma_rate_rad_per_s = {};  ///< Of rates.
  double sigma_range_m = 0.002;
  std::optional<double> sigma_scale = {};     ///< Of the measured angles or rates, relative; 0: exact; none: the log's.
  std::optional<double> sigma_parallax = {};  ///< Camera centre off the axes along the view, over the points' distance.
  double window_s = 6.0;                      ///< Of ObserveMethod::window.
  double max_gap_s = 0.25;  ///< A longer one in a log of rates starts a segment; of angles, it tells no rate.
  int keep_rows = 100000;   ///< Of an Observer's rows: at least so many are kept, at most twice.
};

/// The fields of `config` that a person sets: method, rotation, estimate, start, size, profile, … window_s. The camera
/// comes from a file.
[[nodiscard]] FieldList fields_of(ObserveConfig& config);

/// Throws ConfigError with every fault of a config, in the sentences of the command. observe() does so before any work;
/// who reads large files first may ask before.
void check_config(const ObserveConfig& config);

/// Width and height of the images as the config says them, its own or its camera's; 0, 0: neither. [px]
[[nodiscard]] std::pair<int, int> given_size(const ObserveConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
