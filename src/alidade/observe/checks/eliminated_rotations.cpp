#include "alidade/observe/checks/eliminated_rotations.h"

#include <Eigen/Cholesky>

#include "alidade/geometry/decompositions.h"

namespace alidade {

using Eigen::Index;
using Eigen::MatrixXd;

EliminatedRotations::EliminatedRotations(const Adjustment& reference, Index num_columns)
    : solution_(reference.solution),
      points_(reference.bundle.points.size()),
      alone_(Eigen::VectorXd::Zero(num_columns)) {
  const auto size = static_cast<Index>(3 * reference.bundle.frames.size());
  rotations_.setZero(size, size);
  cross_.setZero(size, num_columns);
  for (PointSums& point : points_) point.by_columns.setZero(3, num_columns);
}

void EliminatedRotations::add(const BundleObservation& seen, double weight, const Eigen::Ref<const MatrixXd>& J,
                              const Eigen::Matrix<double, 2, 3>& by_rotation,
                              const Eigen::Matrix<double, 2, 3>& by_point) {
  PointSums& point = points_[static_cast<std::size_t>(seen.point)];
  point.information.noalias() += weight * by_point.transpose() * by_point;
  point.by_columns.noalias() += weight * by_point.transpose() * J;
  point.by_frame.emplace_back(seen.frame, weight * by_point.transpose() * by_rotation);
  const Index at = 3 * seen.frame;
  rotations_.block<3, 3>(at, at).noalias() += weight * by_rotation.transpose() * by_rotation;
  cross_.middleRows<3>(at).noalias() += weight * by_rotation.transpose() * J;
  alone_ += weight * J.colwise().squaredNorm().transpose();
}

/// In `rotations_` the lower triangle alone.
void EliminatedRotations::eliminate(const PointSums& point, const Eigen::Matrix3d& inverse) {
  MatrixXd by_rotations = MatrixXd::Zero(rotations_.rows(), 3);
  for (const auto& [frame, block] : point.by_frame) by_rotations.middleRows<3>(3 * frame) += block.transpose();
  const Eigen::Matrix3d root = inverse.llt().matrixL();
  rotations_.selfadjointView<Eigen::Lower>().rankUpdate(by_rotations * root, -1.0);
  cross_.noalias() -= by_rotations * (inverse * point.by_columns);
}

void EliminatedRotations::add_priors() {
  for (std::size_t k = 0; k < solution_.rotation_information.size(); ++k) {
    const double information = solution_.rotation_information[k];
    const Index at = static_cast<Index>(3 * k);
    rotations_.diagonal().segment<3>(at).array() += information;
    if (!solution_.rotations_walk || k == 0) continue;
    rotations_.diagonal().segment<3>(at - 3).array() += information;
    rotations_.block<3, 3>(at, at - 3).diagonal().array() -= information;
  }
}

void EliminatedRotations::solve() {
  std::vector<Eigen::Matrix3d> inverses;
  for (const PointSums& point : points_) {
    Eigen::Matrix3d information = point.information;
    information.diagonal().array() += 1e-9;  // a point without observations
    information(2, 2) += 1.0;                // its distance is a metre or more, if there is one
    inverses.emplace_back(information.inverse());
    eliminate(point, inverses.back());
  }
  add_priors();
  rotations_ = MatrixXd(rotations_.selfadjointView<Eigen::Lower>());
  cross_ = -Ldlt(rotations_).solve_each(cross_);
  for (std::size_t i = 0; i < points_.size(); ++i) {
    PointSums& point = points_[i];
    for (const auto& [frame, block] : point.by_frame)
      point.by_columns.noalias() += block * cross_.middleRows<3>(3 * frame);
    point.by_columns = -(inverses[i] * point.by_columns).eval();
  }
}

MatrixXd EliminatedRotations::followed(const BundleObservation& seen, const Eigen::Ref<const MatrixXd>& J,
                                       const Eigen::Matrix<double, 2, 3>& by_rotation,
                                       const Eigen::Matrix<double, 2, 3>& by_point) const {
  return J + by_rotation * cross_.middleRows<3>(3 * seen.frame) +
         by_point * points_[static_cast<std::size_t>(seen.point)].by_columns;
}

void EliminatedRotations::add_prior(int frame, Eigen::VectorXd& gradient, MatrixXd& information) const {
  const auto k = static_cast<std::size_t>(frame);
  MatrixXd follows = cross_.middleRows<3>(3 * frame);
  Eigen::Vector3d error = solution_.rotation_errors[k];
  if (solution_.rotations_walk && frame > 0) {
    follows -= cross_.middleRows<3>(3 * (frame - 1));
    error -= solution_.rotation_errors[k - 1];
  }
  gradient.noalias() += solution_.rotation_information[k] * follows.transpose() * error;
  information.noalias() += solution_.rotation_information[k] * follows.transpose() * follows;
}

bool EliminatedRotations::is_absorbed(Index column, double information) const {
  constexpr double rounding = 1e-7;
  return !(information > rounding * alone_[column]);
}

bool has_rotations(const BundleSolution& solution) { return !solution.rotation_information.empty(); }

RotationFrame rotated_frame(const Adjustment& reference, int frame) {
  RotationFrame rotated = reference.bundle.frames[static_cast<std::size_t>(frame)];
  if (has_rotations(reference.solution))
    rotated.cam_from_start = reference.solution.mount_from_start[static_cast<std::size_t>(frame)];
  return rotated;
}

}  // namespace alidade
