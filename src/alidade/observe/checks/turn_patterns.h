#pragma once

#include <functional>
#include <span>
#include <string>
#include <vector>

#include "alidade/observe/rotation_frame.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// A one-parameter error model of a measured rotation.
struct RotationError {
  std::string cause;      ///< "encoder scale"; errors of one cause are judged together.
  std::string member;     ///< "of pan"
  std::string unit;       ///< Of the parameter: "", "rad", "rad/s".
  std::string quantity;   ///< Name of the parameter in results: "scale_pan".
  double ordinary = 1.0;  ///< Typical σ in instruments.
  double derivative_step = 1e-6;
  /// Corrects the rotation of the rows by the given amount: true = measured · (1 + scale), measured + bias, and so on.
  std::function<void(std::span<RotationRow>, double amount)> undo;
};

/// Heads: angle between the axes; scale of each axis; backlash (the camera lags behind the encoder by half
/// of it); a drifting zero; an error once and twice per revolution. Rates: scale and bias of each axis.
/// Attitudes: drift about each axis. All sources: a clock that runs at another rate than that of the images.
[[nodiscard]] std::vector<RotationError> rotation_errors(RotationSource source, bool has_roll_rate);

/// Change of each row's rotation per unit of an error.
struct TurnPattern {
  RotationError error;
  std::vector<Eigen::Vector3d> turn_rad;  ///< One per row: mount_true = Exp(turn · value) · measured, to first order.
};

/// Patterns of the log's source. None if no rotation was measured.
[[nodiscard]] std::vector<TurnPattern> turn_patterns(const RotationLog& log, double max_gap_s);
/// The same for these errors only.
[[nodiscard]] std::vector<TurnPattern> turn_patterns(const RotationLog& log, const std::vector<RotationError>& errors,
                                                     double max_gap_s);

}  // namespace alidade
