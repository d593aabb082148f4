#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_pose.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// Approximate mounting of a head's camera, from the rotations of its boards: which encoders count
/// backwards, and the remaining misfit.
struct MountingStart {
  Eigen::Quaterniond cam_from_tilt = Eigen::Quaterniond::Identity();
  double pan_scale = 1.0, tilt_scale = 1.0;  ///< 1 or −1.
  double misfit_rad = 0.0;                   ///< Mean angle between the board's poses from views of one placement.
  int num_compared = 0;
};

/// One view: the readings times `unit`, and the rotation of its board.
struct TurnedView {
  Eigen::Vector2d pan_tilt_rad;
  Eigen::Quaterniond cam_from_board;
  std::size_t board = 0;
};

/// Searches the 24 mountings of a cube with each direction of counting, then refines. A few wrong views do not matter.
/// they are few.
[[nodiscard]] MountingStart mounting_start(std::span<const TurnedView> views);

/// Bases of the heads and poses of the boards, propagated from the first head over shared boards by majority of the
/// views. False for heads (and boards) that are not linked to the first.
struct PlacedRig {
  RigState state;
  std::vector<bool> has_head, has_board;
};
/// `state.heads`: with their mountings. `usable`, `poses`: one per view of the problem; no
/// pose: unknown.
[[nodiscard]] PlacedRig place_rig(const RigProblem& problem, const std::vector<RigHead>& heads, std::size_t num_boards,
                                  const std::vector<bool>& usable, std::span<const std::optional<BoardPoseFit>> poses);

}  // namespace alidade
