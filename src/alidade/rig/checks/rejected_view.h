#pragma once

#include <string>

#include "alidade/rig/rig_work.h"

namespace alidade {

/// Why a view was rejected.
struct Rejection {
  std::string reason;
  std::string misreading;  ///< How its row would fit; empty: no tested alternative fits.
};

/// Alternatives tested for the row of a rejected view: its corners numbered from the other end of the board, every
/// other head, every other board, the angles of neighbouring views, pan and tilt exchanged. One that the rig explains
/// (χ² over the number of residuals at most `most`) is named; else the distance of its board from where it should be.
[[nodiscard]] Rejection rejection_of(const Work& work, const RigState& state, std::size_t view, double most);

}  // namespace alidade
