#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/geometry/decompositions.h"
#include "alidade/pantilt/rotation_log.h"

namespace alidade {

/// The rotation of the image between two rows, for an assumed focal length, and how far the points moved.
struct ImageTurn {
  Eigen::Vector3d turn = Eigen::Vector3d::Zero();
  double moved_px = 0.0;  ///< Median over the points.
};

/// Robust fit of a small rotation to the flow of the points; none: fewer than four points in common.
[[nodiscard]] std::optional<ImageTurn> image_turn(const RotationRow& from, const RotationRow& to,
                                                  const Eigen::Vector2d& centre, double focal_px);

/// Huber weights: errors beyond twice the median count linearly (P. J. Huber 1964).
void weigh_errors(const std::vector<double>& off, std::vector<double>& weights);

/// Solves the normal equations A x = b with slight damping, so that undetermined directions stay zero.
template <int Num>
Eigen::Matrix<double, Num, 1> solved(const Eigen::Matrix<double, Num, Num>& A, const Eigen::Matrix<double, Num, 1>& b) {
  constexpr double hardly = 1e-9;
  const double size = A.trace() / Num;
  Eigen::Matrix<double, Num, Num> damped = A;
  damped.diagonal().array() += hardly * size + 1e-300;
  return solve_symmetric(damped, b);
}

}  // namespace alidade
