#include "alidade/localize/pose_chain.h"

#include <Eigen/Cholesky>

namespace alidade {
namespace {

constexpr int rest_dim = PoseChain::window - PoseChain::pose_dim;
using PoseMatrix = Eigen::Matrix<double, PoseChain::pose_dim, PoseChain::pose_dim>;

}  // namespace

PoseChain::PoseChain(int border_dim)
    : A(Eigen::Matrix<double, window, window>::Zero()),
      U(Eigen::Matrix<double, window, Eigen::Dynamic>::Zero(window, border_dim)),
      B(Eigen::MatrixXd::Zero(border_dim, border_dim)),
      a(Eigen::Vector<double, window>::Zero()),
      b(Eigen::VectorXd::Zero(border_dim)) {}

bool PoseChain::eliminate() {
  const Eigen::LLT<PoseMatrix> llt(A.topLeftCorner<pose_dim, pose_dim>());
  if (llt.info() != Eigen::Success) return false;
  Left left;
  left.L = llt.matrixL();
  const auto L = left.L.triangularView<Eigen::Lower>();
  left.W_poses = L.solve(A.bottomLeftCorner<rest_dim, pose_dim>().transpose());
  left.W_border = L.solve(U.topRows<pose_dim>());
  left.y = L.solve(a.head<pose_dim>());
  const Eigen::Matrix<double, rest_dim, rest_dim> A_rest =
      A.bottomRightCorner<rest_dim, rest_dim>() - left.W_poses.transpose() * left.W_poses;
  const Eigen::Matrix<double, rest_dim, Eigen::Dynamic> U_rest =
      U.bottomRows<rest_dim>() - left.W_poses.transpose() * left.W_border;
  const Eigen::Vector<double, rest_dim> a_rest = a.tail<rest_dim>() - left.W_poses.transpose() * left.y;
  B.selfadjointView<Eigen::Lower>().rankUpdate(left.W_border.transpose(), -1.0);
  b.noalias() -= left.W_border.transpose() * left.y;
  A.setZero();
  U.setZero();
  a.setZero();
  A.topLeftCorner<rest_dim, rest_dim>() = A_rest;
  U.topRows<rest_dim>() = U_rest;
  a.head<rest_dim>() = a_rest;
  left_.push_back(std::move(left));
  return true;
}

double PoseChain::gain() const {
  double sum = 0.0;
  for (const Left& left : left_) sum += left.y.squaredNorm();
  return sum;
}

std::vector<Eigen::Vector<double, PoseChain::pose_dim>> PoseChain::steps(const Eigen::VectorXd& border) const {
  std::vector<Eigen::Vector<double, pose_dim>> steps(left_.size());
  Eigen::Vector<double, rest_dim> after = Eigen::Vector<double, rest_dim>::Zero();
  for (std::size_t k = left_.size(); k-- > 0;) {
    const Left& left = left_[k];
    const Eigen::Vector<double, pose_dim> rhs = left.y - left.W_poses * after - left.W_border * border;
    steps[k] = left.L.transpose().triangularView<Eigen::Upper>().solve(rhs);
    after.tail<pose_dim>() = after.head<pose_dim>().eval();
    after.head<pose_dim>() = steps[k];
  }
  return steps;
}

PoseChain::Spread PoseChain::spread(const Eigen::MatrixXd& border_cov, const Eigen::MatrixXd& J_border) const {
  const auto num_border = border_cov.cols(), num_moved = J_border.cols();
  Spread spread;
  spread.cov.resize(left_.size());
  spread.J.resize(left_.size());
  Eigen::Matrix<double, rest_dim, rest_dim> P = Eigen::Matrix<double, rest_dim, rest_dim>::Zero();
  Eigen::Matrix<double, rest_dim, Eigen::Dynamic> P_border(rest_dim, num_border), J(rest_dim, num_moved);
  P_border.setZero();
  J.setZero();
  Eigen::Matrix<double, pose_dim, Eigen::Dynamic> X_border(pose_dim, num_border);
  for (std::size_t k = left_.size(); k-- > 0;) {
    const Left& left = left_[k];
    const auto L_transposed = left.L.transpose().triangularView<Eigen::Upper>();
    const Eigen::Matrix<double, pose_dim, rest_dim> X = left.W_poses * P + left.W_border * P_border.transpose();
    X_border.noalias() = left.W_border * border_cov;
    X_border += left.W_poses * P_border;
    PoseMatrix inner = X * left.W_poses.transpose() + X_border * left.W_border.transpose();
    inner += PoseMatrix::Identity();
    const PoseMatrix half = L_transposed.solve(inner);
    const PoseMatrix cov = L_transposed.solve(half.transpose());
    spread.cov[k] = 0.5 * (cov + cov.transpose());
    spread.J[k] = -L_transposed.solve(left.W_poses * J + left.W_border * J_border);
    const PoseMatrix cross = -L_transposed.solve(X.leftCols<pose_dim>());
    P.bottomRightCorner<pose_dim, pose_dim>() = P.topLeftCorner<pose_dim, pose_dim>().eval();
    P.topLeftCorner<pose_dim, pose_dim>() = spread.cov[k];
    P.topRightCorner<pose_dim, pose_dim>() = cross;
    P.bottomLeftCorner<pose_dim, pose_dim>() = cross.transpose();
    P_border.bottomRows<pose_dim>() = P_border.topRows<pose_dim>().eval();
    P_border.topRows<pose_dim>() = -L_transposed.solve(X_border);
    J.bottomRows<pose_dim>() = J.topRows<pose_dim>().eval();
    J.topRows<pose_dim>() = spread.J[k];
  }
  return spread;
}

}  // namespace alidade
