#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/rig/rig_solve.h"

namespace alidade {

/// A viewing ray through a head's centre and the point seen along it.
struct ObservationLine {
  Eigen::Vector3d direction_in_base;  ///< Unit vector.
  Eigen::Vector3d point_in_board;
};

/// Pose of points that are seen along such lines, by orthogonal iteration from the 24 rotations of a cube, and the mean
/// capped angle that remains. None for fewer than six lines. Lu, Hager & Mjolsness, "Fast and globally convergent
/// pose estimation from video images", 2000.
struct ObservationPose {
  Rigid3 base_from_board;
  double misfit_rad = 0.0;
};
[[nodiscard]] std::optional<ObservationPose> pose_of_observation_lines(std::span<const ObservationLine> lines);

/// Pose of a board from all views of one head if no single view determines it: a few points each, at many angles.
/// Offsets are taken as zero. `usable`: one per view of the problem.
[[nodiscard]] std::optional<ObservationPose> observation_pose(const RigProblem& problem,
                                                              const std::vector<bool>& usable, const RigHead& rig_head,
                                                              std::size_t head, std::size_t board);

/// The 24 rotations that map a cube to itself.
[[nodiscard]] std::vector<Eigen::Quaterniond> turns_of_a_cube();

}  // namespace alidade
