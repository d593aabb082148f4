#pragma once

#include "alidade/estimation/progress.h"
#include "alidade/observe/intrinsics_estimate.h"

#include <vector>

namespace alidade {

/// What is known of a rotating camera now.
struct ObservedNow {
  int width_px = 0, height_px = 0;
  Eigen::Vector4d k_px{0.0, 0.0, 0.0, 0.0};  ///< fx, fy, cx, cy.
  Eigen::Matrix4d cov_px2 = Eigen::Matrix4d::Zero();
  std::vector<Eigen::Vector2d> points_px;  ///< Seen now.
  double sigma_px = 0.3;
};

struct MoveLimits {
  double rate_rad_per_s = 0.2;  ///< Of each axis.
  double max_turn_rad = 0.5;    ///< Away from here, each axis.
  bool can_roll = false;
  double frames_per_s = 30.0;
};

/// Turn to this pan, tilt, roll (from where the camera looks now), and what will be known then if enough points stay in
/// the image.
struct NextMove {
  Eigen::Vector3d pan_tilt_roll_rad = Eigen::Vector3d::Zero();
  double duration_s = 0.0;
  Eigen::Vector4d sigma_px = Eigen::Vector4d::Zero();  ///< Of fx, fy, cx, cy after it.
};

/// The moves that lower the uncertainty of fx, fy, cx, cy most, one after the other: each is the best of turns in eight
/// directions and three lengths (and rolls), by the information of the pixels on the way, with the points' bearings
/// unknown. Empty: no point is seen, or none stays in the image.
[[nodiscard]] std::vector<NextMove> plan_next_moves(const ObservedNow& now, const MoveLimits& limits, int num_moves,
                                                    const Progress& progress = {});

}  // namespace alidade
