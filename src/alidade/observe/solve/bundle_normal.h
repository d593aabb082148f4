#pragma once

#include <vector>

#include "alidade/observe/solve/rotation_model.h"

namespace alidade {

/// Rows of a point, or of a frame's rotation, by the shared parameters.
using ByCommon = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// A point's own part of the normal equations, or a frame's rotation's.
struct NormalBlock {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  ByCommon by_common;
};

/// What a point seen in a frame has in common with the frame's rotation.
struct PointFrameBlock {
  int point = 0, frame = 0;
  Eigen::Matrix3d information;  ///< Point × rotation.
};

/// Normal equations of a rotation bundle: shared parameters, points, and frames' rotations, where they are estimated.
struct BundleNormal {
  Eigen::MatrixXd common;    ///< n × n
  Eigen::VectorXd gradient;  ///< n, of half the cost.
  std::vector<NormalBlock> points, frames;
  std::vector<PointFrameBlock> crossings;  ///< Frame by frame.
  std::vector<double> walk;                ///< Information of each frame's step from the one before; empty: none walks.
  bool frames_are_measured = false;        ///< Each by itself: its block is positive definite without any point.
};

struct BundleStep {
  Eigen::VectorXd common;
  std::vector<Eigen::Vector3d> points, frames;
};

/// The step that makes the gradient zero, diagonals times 1 + damping (Levenberg–Marquardt). Of points and frames those
/// that are more are eliminated block by block (Schur complement): the time grows linearly in them, and with the cube
/// of the others. Rotations that walk hold to each other: then it is the points.
[[nodiscard]] BundleStep bundle_step(const BundleNormal& normal, double damping);

/// Of the shared parameters, all else eliminated. `prior`, n × n, is taken off first.
[[nodiscard]] CommonMatrix common_information(const BundleNormal& normal, const CommonMatrix& prior);

/// How points and rotations follow the shared parameters: 3 × n each.
struct BundleSlopes {
  std::vector<ByCommon> points, frames;
};
[[nodiscard]] BundleSlopes slopes_by_common(const BundleNormal& normal);

/// A point's information, invertible also where no observation binds it.
[[nodiscard]] Eigen::Matrix3d inverse_of_point(const NormalBlock& point, double damping);

}  // namespace alidade
