#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board_pose.h"
#include "alidade/rig/rig_solve.h"

namespace alidade {

/// How the camera of a head is mounted, roughly, from the rotation of its boards: which of its encoders count
/// backwards, and what is left unexplained.
struct MountingStart {
  Eigen::Quaterniond cam_from_tilt = Eigen::Quaterniond::Identity();
  double pan_scale = 1.0, tilt_scale = 1.0;  ///< 1 or −1.
  double misfit_rad = 0.0;                   ///< Mean angle between the board's poses by the views of one placement.
  int num_compared = 0;
};

/// One view as seen: the readings times `unit`, and its board's rotation.
struct TurnedView {
  Eigen::Vector2d pan_tilt_rad;
  Eigen::Quaterniond cam_from_board;
  std::size_t board = 0;
};

/// Searches the 24 mountings that a cube has, each way of counting, then refines. Wrong views do not matter as long as
/// they are few.
[[nodiscard]] MountingStart mounting_start(std::span<const TurnedView> views);

/// Bases of the heads and poses of the boards, propagated from the first head over shared boards by what most views
/// say. Heads (and boards) that nothing links to the first are false.
struct PlacedRig {
  RigState state;
  std::vector<bool> has_head, has_board;
};
/// `state.heads`: with their mountings. `usable`, `poses`: one per view of the problem; no
/// pose: not known.
[[nodiscard]] PlacedRig place_rig(const RigProblem& problem, const std::vector<RigHead>& heads, std::size_t num_boards,
                                  const std::vector<bool>& usable, std::span<const std::optional<BoardPoseFit>> poses);

}  // namespace alidade
