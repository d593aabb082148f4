#pragma once

#include <string>

#include "alidade/rig/rig_work.h"

namespace alidade {

/// Why a view was rejected.
struct Rejection {
  std::string reason;
  std::string misreading;  ///< How its row would fit; empty: as nothing that was tried.
};

/// Tried on the row of a view that was rejected: its corners from the other end of the board, each other head, each
/// other board, angles of the views beside it, pan and tilt exchanged. One that the rig explains, χ² over the count of
/// its residuals at most `most`, is named; else how far its board is from where it should be.
[[nodiscard]] Rejection rejection_of(const Work& work, const RigState& state, std::size_t view, double most);

}  // namespace alidade
