#pragma once

#include <span>
#include <string>
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

/// The shortest way to a pose that is tried, but for none.
[[nodiscard]] double shortest_way_rad(const MoveLimits& limits);
/// Whether a way has frames that can be counted, one at least: 100 000 at most, near an hour at 30 a second.
[[nodiscard]] bool is_short_enough(double way_rad, const MoveLimits& limits);

/// The moves that lower the uncertainty of fx, fy, cx, cy most, one after the other: each is the best of rotations in
/// eight directions and three lengths (and rolls), by the information of the pixels along the move, with the points'
/// bearings unknown. Empty: no point is seen, none stays in the image, or
/// every move takes too long.
[[nodiscard]] std::vector<NextMove> plan_next_moves(const ObservedNow& now, const MoveLimits& limits, int num_moves,
                                                    const Progress& progress = {});

/// Where the points are at the end of the log: seen within its last quarter of a second, or, where those are fewer than
/// four, where each was seen last.
[[nodiscard]] std::vector<Eigen::Vector2d> points_at_end(std::span<const ObserveResidual> seen, double frames_per_s);

/// Adds what an observation estimated beside fx, fy, cx, cy, by its name in results ("k1", "mount_x_rad"), as assumed
/// with that σ: the moves do not estimate it. Nothing where no cause of that name is counted.
void assume_estimated(const std::string& quantity, double sigma, std::vector<Assumption>& assumed);

}  // namespace alidade
