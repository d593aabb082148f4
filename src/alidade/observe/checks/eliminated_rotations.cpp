#include "alidade/observe/checks/eliminated_rotations.h"

namespace alidade {

using Eigen::Index;
using Eigen::MatrixXd;

EliminatedRotations::EliminatedRotations(const Adjustment& reference, Index num_columns)
    : solution_(reference.solution), alone_(Eigen::VectorXd::Zero(num_columns)) {
  NormalBlock none;
  none.by_common.setZero(3, num_columns);
  normal_.common.setZero(num_columns, num_columns);
  normal_.gradient.setZero(num_columns);
  normal_.points.assign(reference.bundle.points.size(), none);
  normal_.frames.assign(reference.bundle.frames.size(), none);
  normal_.frames_are_measured = !solution_.rotations_walk;
  for (std::size_t k = 0; k < normal_.frames.size(); ++k) {
    const double information = solution_.rotation_information[k];
    normal_.frames[k].information.diagonal().array() += information;
    normal_.frames_are_measured = normal_.frames_are_measured && information > 0.0;
    if (!solution_.rotations_walk) continue;
    normal_.walk.push_back(information);
    if (k > 0) normal_.frames[k - 1].information.diagonal().array() += information;
  }
}

void EliminatedRotations::add(const BundleObservation& seen, double weight, const Eigen::Ref<const MatrixXd>& J,
                              const Eigen::Matrix<double, 2, 3>& by_rotation,
                              const Eigen::Matrix<double, 2, 3>& by_point) {
  NormalBlock& point = normal_.points[static_cast<std::size_t>(seen.point)];
  point.information.noalias() += weight * by_point.transpose() * by_point;
  point.by_common.noalias() += weight * by_point.transpose() * J;
  NormalBlock& frame = normal_.frames[static_cast<std::size_t>(seen.frame)];
  frame.information.noalias() += weight * by_rotation.transpose() * by_rotation;
  frame.by_common.noalias() += weight * by_rotation.transpose() * J;
  normal_.crossings.push_back({seen.point, seen.frame, weight * by_point.transpose() * by_rotation});
  alone_ += weight * J.colwise().squaredNorm().transpose();
}

void EliminatedRotations::solve() {
  // Prior of the third coordinate, inverse depth [1/m], if there is one: σ = 1/m, i.e. a metre or farther.
  for (NormalBlock& point : normal_.points) point.information(2, 2) += 1.0;
  slopes_ = slopes_by_common(normal_);
  normal_.crossings.clear();
}

MatrixXd EliminatedRotations::followed(const BundleObservation& seen, const Eigen::Ref<const MatrixXd>& J,
                                       const Eigen::Matrix<double, 2, 3>& by_rotation,
                                       const Eigen::Matrix<double, 2, 3>& by_point) const {
  return J + by_rotation * slopes_.frames[static_cast<std::size_t>(seen.frame)] +
         by_point * slopes_.points[static_cast<std::size_t>(seen.point)];
}

void EliminatedRotations::add_prior(int frame, Eigen::VectorXd& gradient, MatrixXd& information) const {
  const auto k = static_cast<std::size_t>(frame);
  MatrixXd follows = slopes_.frames[k];
  Eigen::Vector3d error = solution_.rotation_errors[k];
  if (solution_.rotations_walk && frame > 0) {
    follows -= slopes_.frames[k - 1];
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
