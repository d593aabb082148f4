#pragma once

#include "alidade/observe/config.h"
#include "alidade/observe/solve/rotation_model.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// A config as the estimators use it: words and camera are resolved. `start` defaults to that of the camera.
struct ObserveSetup : ObserveConfig {
  ObserveNuisances nuisances;  ///< Beside fx, fy, cx, cy: k1, k2, k3, tangential, mount, delay, lever, shutter.
  std::vector<std::string> estimate_errors;  ///< Errors of the measured rotation: causes of rotation_errors().
  bool estimate_auto = false;                ///< Also estimate what the residuals indicate.
  bool lens_is_given = false;                ///< The pixels are undistorted with a given lens, which is not estimated.
  bool is_no_lever = false;                  ///< The estimated lever was implausible for a head: it is not tried again.
  std::optional<double> sigma_k1;            ///< σ of k1 of the given lens.
};

/// Throws ConfigError as check_config() does.
[[nodiscard]] ObserveSetup setup_of(const ObserveConfig& config);

/// Throws ConfigError if rows of such a log are invalid: the number of pixels is not that of points, time decreases, or
/// the truth does not cover every row.
void check_log(const RotationLog& log);
void check_row(const RotationRow& row, std::size_t number, const RotationLog& layout, double not_before_s);

/// Throws ConfigError if errors of the rotation are to be estimated that
/// this log cannot have: backlash of rates, a scale that is given as exact.
void check_rotation_words(const ObserveSetup& setup, const RotationLog& log);

/// The nuisance that a cause of the residuals ("k1", "rolling shutter") belongs to; null if it is none.
[[nodiscard]] bool ObserveNuisances::*nuisance_of(const std::string& word);
/// The word of `estimate` for a cause: "k1,k2", "mount", "scale", "backlash".
[[nodiscard]] std::string estimate_word_of(const std::string& cause);
/// Time of a row to a hundredth of a second, for any epoch: "12.34 s".
[[nodiscard]] std::string row_time_text(double t_s);
/// The causes that a word stands for and that are errors of the measured rotation; empty if there are none.
[[nodiscard]] std::vector<std::string> rotation_causes_of(const std::string& word);

/// Pixels as a camera without distortion but with the same fx, fy, cx, cy would have seen them; pixels that the lens
/// cannot have seen become `unseen`.
void undistort(const Camera& camera, const Eigen::Vector2d& unseen, std::vector<Eigen::Vector2d>& pixels);

}  // namespace alidade
