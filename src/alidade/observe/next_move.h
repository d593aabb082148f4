#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/observe/move_plan.h"

namespace alidade {

struct MoveLimits {
  double rate_rad_per_s = 0.2;  ///< Per axis.
  double max_turn_rad = 0.5;    ///< Largest angle from the current direction, per axis.
  bool can_roll = false;
  double frames_per_s = 30.0;
};

/// The shortest way to a candidate pose, except the zero one.
[[nodiscard]] double shortest_way_rad(const MoveLimits& limits);
/// Whether the frames of a way can be counted: at least one, at most 100 000, about an hour at 30 per second.
[[nodiscard]] bool is_short_enough(double way_rad, const MoveLimits& limits);

/// The moves that lower the uncertainty of fx, fy, cx, cy most, chosen greedily: each is the best of rotations in eight
/// directions and three lengths (and rolls), by the information of the pixels along the move, with unknown bearings of
/// the points. Empty if no point is seen, none stays in the image, or
/// every move takes too long.
[[nodiscard]] std::vector<NextMove> plan_next_moves(const ObservedNow& now, const MoveLimits& limits, int num_moves,
                                                    const Progress& progress = {});

/// The points at the end of the log: those seen within its last quarter of a second or, if these are fewer than four,
/// each where it was seen last.
[[nodiscard]] std::vector<Eigen::Vector2d> points_at_end(std::span<const ObserveResidual> seen, double frames_per_s);

/// Adds a parameter that an observation estimated beside fx, fy, cx, cy, by its name in results ("k1", "mount_x_rad"),
/// as assumed with its σ: the moves do not estimate it. Does nothing if no cause of that name is counted.
void assume_estimated(const std::string& quantity, double sigma, std::vector<Assumption>& assumed);

}  // namespace alidade
