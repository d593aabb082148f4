#pragma once

#include <vector>

#include "alidade/observe/solve/rotation_model.h"

namespace alidade {

/// Block of a point, or of a frame's rotation, with the shared parameters.
using ByCommon = Eigen::Matrix<double, 3, Eigen::Dynamic>;

/// Diagonal block of a point, or of a frame's rotation, in the normal equations.
struct NormalBlock {
  Eigen::Matrix3d information = Eigen::Matrix3d::Zero();
  Eigen::Vector3d gradient = Eigen::Vector3d::Zero();
  ByCommon by_common;
};

/// Off-diagonal block of a point and the rotation of a frame in which it is seen.
struct PointFrameBlock {
  int point = 0, frame = 0;
  Eigen::Matrix3d information;  ///< Point × rotation.
};

/// Normal equations of a rotation bundle: shared parameters, points and, if estimated, the rotations of the frames.
struct BundleNormal {
  Eigen::MatrixXd common;    ///< n × n
  Eigen::VectorXd gradient;  ///< n; gradient of half the cost.
  std::vector<NormalBlock> points, frames;
  std::vector<PointFrameBlock> crossings;  ///< In the order of frames.
  std::vector<double> walk;                ///< Information of each frame's step from the last; empty: no walk.
  bool frames_are_measured = false;        ///< Each by itself: its block is positive definite without points.
};

struct BundleStep {
  Eigen::VectorXd common;
  std::vector<Eigen::Vector3d> points, frames;
};

/// The Levenberg–Marquardt step with diagonals times 1 + damping. Of points and frames, the more numerous
/// kind is eliminated block by block (Schur complement): the time is linear in their number, and cubic in
/// that of the other kind. Rotations of a random walk are coupled: then the points are eliminated.
[[nodiscard]] BundleStep bundle_step(const BundleNormal& normal, double damping);

/// Information of the shared parameters, all else eliminated. `prior`, n × n, is subtracted first.
[[nodiscard]] CommonMatrix common_information(const BundleNormal& normal, const CommonMatrix& prior);

/// Derivatives of points and rotations by the shared parameters at the optimum: 3 × n each.
struct BundleSlopes {
  std::vector<ByCommon> points, frames;
};
[[nodiscard]] BundleSlopes slopes_by_common(const BundleNormal& normal);

/// Inverse of a point's information; also valid for a point without observations.
[[nodiscard]] Eigen::Matrix3d inverse_of_point(const NormalBlock& point, double damping);

}  // namespace alidade
