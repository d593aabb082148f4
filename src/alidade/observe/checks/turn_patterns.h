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
  std::string unit;       ///< Of the number: "", "rad", "rad/s".
  std::string quantity;   ///< Its name in results: "scale_pan".
  double ordinary = 1.0;  ///< Typical σ of it in instruments.
  double derivative_step = 1e-6;
  /// Corrects the rows' rotation by so much of it: true = measured · (1 + scale), measured + bias, and so on.
  std::function<void(std::span<RotationRow>, double amount)> undo;
};

/// Of heads: the angle between the axes, scale of each axis, backlash (the camera lags behind the encoder by half of
/// it), a zero that drifts, an error once and twice a turn. Of rates: scale and bias of each axis. Of attitudes: a
/// drift about each axis. Of all: a clock that goes at another rate than the images'.
[[nodiscard]] std::vector<RotationError> rotation_errors(RotationSource source, bool has_roll_rate);

/// By how much each row's rotation changes, per unit of it.
struct TurnPattern {
  RotationError error;
  std::vector<Eigen::Vector3d> turn_rad;  ///< One per row: mount_true = Exp(turn · number) · measured, to first order.
};

/// Patterns of the log's source. None where no rotation was measured.
[[nodiscard]] std::vector<TurnPattern> turn_patterns(const RotationLog& log, double max_gap_s);
/// The same of these errors alone.
[[nodiscard]] std::vector<TurnPattern> turn_patterns(const RotationLog& log, const std::vector<RotationError>& errors,
                                                     double max_gap_s);

}  // namespace alidade
