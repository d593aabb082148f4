#pragma once

#include <string>
#include <vector>

#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// A way in which the measured rotation may be wrong: by how much each row's turns, per unit of it.
struct TurnPattern {
  std::string cause;                      ///< "encoder scale"; patterns of one cause are judged together.
  std::string member;                     ///< "of pan"
  std::string unit;                       ///< Of the coefficient: "", "rad", "rad/s".
  std::vector<Eigen::Vector3d> turn_rad;  ///< One a row: mount_true = Exp(turn · coefficient) · measured.
};

/// Patterns of the log's source, to first order. Heads: scale of each axis, an error once and twice a turn, backlash
/// (half of it either way, by the axis' last motion), a zero that drifts. Rates: scale and bias of each axis.
/// Attitudes: a drift about each axis. None where no rotation was measured.
[[nodiscard]] std::vector<TurnPattern> turn_patterns(const RotationLog& log, double max_gap_s);

}  // namespace alidade
