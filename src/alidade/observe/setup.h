#pragma once

#include "alidade/observe/config.h"
#include "alidade/observe/solve/rotation_model.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// A config as the estimators take it: what its words and its camera say. `start` is the camera's where none is given.
struct ObserveSetup : ObserveConfig {
  ObserveNuisances nuisances;  ///< Beside fx, fy, cx, cy: k1, k2, k3, tangential, mount, delay, lever, shutter.
  std::vector<std::string> estimate_errors;  ///< And errors of the measured rotation: causes of rotation_errors().
  bool estimate_auto = false;                ///< And what the residuals ask for.
  bool lens_is_given = false;                ///< The pixels are freed of a lens that is given: it is not estimated.
  bool is_no_lever = false;                  ///< One was estimated as no head has it: it is not asked for again.
  std::optional<double> sigma_k1;            ///< Of the lens that is given.
};

/// Throws ConfigError as check_config() does.
[[nodiscard]] ObserveSetup setup_of(const ObserveConfig& config);

/// Throws ConfigError where rows of such a log cannot be so: pixels that are not as many as points, time that goes
/// back, a truth that is not of every row.
void check_log(const RotationLog& log);
void check_row(const RotationRow& row, std::size_t number, const RotationLog& layout, double not_before_s);

/// Throws ConfigError where errors of the rotation are to be estimated that this log cannot have: backlash of rates, a
/// scale that is given as exact.
void check_rotation_words(const ObserveSetup& setup, const RotationLog& log);

/// Whether a cause of the residuals, "k1", "rolling shutter", is one of the nuisances; null: it is none.
[[nodiscard]] bool ObserveNuisances::*nuisance_of(const std::string& word);
/// The word of `estimate` for a cause: "k1,k2", "mount", "scale", "backlash".
[[nodiscard]] std::string estimate_word_of(const std::string& cause);
/// A row's time to a hundredth of a second, of whatever epoch: "12.34 s".
[[nodiscard]] std::string row_time_text(double t_s);
/// The causes of a word that are errors of the measured rotation; empty: it is none of them.
[[nodiscard]] std::vector<std::string> rotation_causes_of(const std::string& word);

/// Pixels as a camera without distortion but the same fx, fy, cx, cy would have seen them; those that the lens cannot
/// have seen become `unseen`.
void undistort(const Camera& camera, const Eigen::Vector2d& unseen, std::vector<Eigen::Vector2d>& pixels);

}  // namespace alidade
