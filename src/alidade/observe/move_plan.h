#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/estimation/counts.h"
#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/observe/report.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// The current estimate of a rotating camera.
struct ObservedNow {
  int width_px = 0, height_px = 0;
  Eigen::Vector4d k_px{0.0, 0.0, 0.0, 0.0};  ///< fx, fy, cx, cy.
  Eigen::Matrix4d cov_px2 = Eigen::Matrix4d::Zero();
  std::vector<Eigen::Vector2d> points_px;  ///< Points in view now.
  double sigma_px = 0.3;
  double frames_per_s = 30.0;
  /// σ of fx, fy, cx, cy for independent pixel errors and exact given values; zero: use cov_px2.
  Eigen::Vector4d sigma_model_px = Eigen::Vector4d::Zero();
  double design_effect = 1.0;  ///< Variance of sums of pixel errors over that of independent ones.
  RotationSource source = RotationSource::head;
  double sigma_angle_rad = 0.0, sigma_rate_rad_per_s = 0.0;  ///< σ of the measured rotation; 0: exact.
  std::vector<Assumption> assumed = {};                      ///< Also taken as given by the moves.
};

/// A rotation to this pan, tilt and roll, relative to the present view, and σ expected after it if enough points stay
/// in the image.
struct NextMove {
  Eigen::Vector3d pan_tilt_roll_rad = Eigen::Vector3d::Zero();
  double duration_s = 0.0;
  Eigen::Vector4d sigma_px = Eigen::Vector4d::Zero();  ///< σ of fx, fy, cx, cy after the move.
};

/// What the head can do, and how many moves are requested.
struct MoveConfig {
  int moves = 3;
  double rate_deg_s = 15.0;    ///< Speed of each axis.
  double max_turn_deg = 30.0;  ///< Largest rotation of each axis from the present view.
  bool roll = false;           ///< The head can also roll.
};

[[nodiscard]] FieldList fields_of(MoveConfig& config);

struct MovePlan {
  ObservedNow now;
  MoveConfig config;
  std::vector<NextMove> moves = {};
  Counts counts = {};
  Verdict verdict = {};
};

/// The moves that reduce the uncertainty of fx, fy, cx, cy most, one after the other. Throws ConfigError for an invalid
/// config or camera.
[[nodiscard]] MovePlan plan_moves(const ObservedNow& now, const MoveConfig& config = {}, const Progress& progress = {});

/// The camera of a report, its uncertainty, and the last observed positions of the points. Throws ConfigError if the
/// report has no camera, or the rotation was not measured.
[[nodiscard]] ObservedNow observed_now(const ObserveReport& report);

ALIDADE_PUBLIC_END
}  // namespace alidade
