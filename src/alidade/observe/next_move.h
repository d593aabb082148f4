#pragma once

#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/observe/move_plan.h"

namespace alidade {

struct MoveLimits {
  double rate_rad_per_s = 0.2;  ///< Of each axis.
  double max_turn_rad = 0.5;    ///< Away from here, each axis.
  bool can_roll = false;
  double frames_per_s = 30.0;
};

/// The moves that lower the uncertainty of fx, fy, cx, cy most, one after the other: each is the best of rotations in
/// eight directions and three lengths (and rolls), by the information of the pixels along the move, with the points'
/// bearings unknown. Empty: no point is seen, or none stays in the image.
[[nodiscard]] std::vector<NextMove> plan_next_moves(const ObservedNow& now, const MoveLimits& limits, int num_moves,
                                                    const Progress& progress = {});

}  // namespace alidade
