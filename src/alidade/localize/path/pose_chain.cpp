#include "alidade/localize/path/pose_chain.h"

#include <Eigen/Cholesky>
#include <algorithm>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/panel_loops.h"

namespace alidade {
namespace {

using PoseMatrix = Eigen::Matrix<double, PoseChain::pose_dim, PoseChain::pose_dim>;

}  // namespace

PoseChain::PoseChain(int num_shared, int num_points)
    : A(Eigen::Matrix<double, window, window>::Zero()),
      U(Eigen::Matrix<double, window, Eigen::Dynamic>::Zero(window, num_shared + 3 * num_points)),
      B(Eigen::MatrixXd::Zero(num_shared + 3 * num_points, num_shared + 3 * num_points)),
      a(Eigen::Vector<double, window>::Zero()),
      b(Eigen::VectorXd::Zero(num_shared + 3 * num_points)),
      num_shared_(num_shared),
      num_used_(num_shared),
      is_taken_(static_cast<std::size_t>(num_points), false) {}

int PoseChain::enter(std::size_t point) {
  const auto free = std::ranges::find(is_taken_, false) - is_taken_.begin();
  is_taken_[static_cast<std::size_t>(free)] = true;
  if (place_of_.size() <= point) place_of_.resize(point + 1, -1);
  const int place = num_shared_ + 3 * static_cast<int>(free);
  place_of_[point] = place;
  num_used_ = std::max(num_used_, place + 3);
  Step step;
  step.event = Event::entered;
  step.index = point;
  step.place = place;
  steps_.push_back(std::move(step));
  return place;
}

void PoseChain::add_square(const Eigen::VectorXd& v, double weight) {
  take_from_border({});
  square_ = v;
  square_weight_ = weight;
}

/// B − Wᵀ W, together with the pending square.
void PoseChain::take_from_border(const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic>& W) {
  using panel_loops::panel;
  const int num_rows = static_cast<int>(W.rows()), num = num_rows + (square_weight_ != 0.0 ? 1 : 0);
  if (num == 0) return;
  const auto place = [num](int i) { return static_cast<std::size_t>(i / panel * num * panel + i % panel); };
  left_.assign(place((num_used_ + panel - 1) / panel * panel), 0.0);
  for (int i = 0; i < num_used_; ++i)
    for (int k = 0; k < num_rows; ++k) left_[place(i) + static_cast<std::size_t>(k * panel)] = W(k, i);
  if (num == num_rows) {
    panel_loops::subtract_lower(left_.data(), left_.data(), num, num_used_, B.data(),
                                static_cast<std::size_t>(B.outerStride()));
    return;
  }
  right_ = left_;
  for (int i = 0; i < num_used_; ++i) {
    const std::size_t at = place(i) + static_cast<std::size_t>(num_rows * panel);
    left_[at] = square_[i];
    right_[at] = -square_weight_ * square_[i];
  }
  square_weight_ = 0.0;
  panel_loops::subtract_lower(left_.data(), right_.data(), num, num_used_, B.data(),
                              static_cast<std::size_t>(B.outerStride()));
}

/// Schur complement for the remaining poses and the border.
void PoseChain::take_out(const Step& step) {
  A.topLeftCorner<rest_dim, rest_dim>() -= step.W_poses.transpose() * step.W_poses;
  U.topLeftCorner(rest_dim, num_used_).noalias() -= step.W_poses.transpose() * step.W_border;
  a.head<rest_dim>() -= step.W_poses.transpose() * step.y;
  take_from_border(step.W_border);
  b.head(num_used_).noalias() -= step.W_border.transpose() * step.y;
}

bool PoseChain::leave(std::size_t point) {
  take_from_border({});
  const int at = place_of_[point], after = at + 3;
  const Eigen::LLT<Eigen::Matrix3d> llt(B.block<3, 3>(at, at));
  if (llt.info() != Eigen::Success) return false;
  Step step;
  step.event = Event::left;
  step.index = point;
  step.place = at;
  step.L = llt.matrixL();
  const auto L = llt.matrixL();
  step.W_poses = U.block<rest_dim, 3>(0, at).transpose();
  step.W_border = Eigen::MatrixXd::Zero(3, num_used_);
  step.W_border.leftCols(at) = B.block(at, 0, 3, at);
  step.W_border.rightCols(num_used_ - after) = B.block(after, at, num_used_ - after, 3).transpose();
  step.y = b.segment<3>(at);
  L.solveInPlace(step.W_poses);
  L.solveInPlace(step.W_border);
  L.solveInPlace(step.y);
  take_out(step);
  U.middleCols<3>(at).setZero();
  B.middleRows<3>(at).setZero();
  B.middleCols<3>(at).setZero();
  b.segment<3>(at).setZero();
  steps_.push_back(std::move(step));
  is_taken_[static_cast<std::size_t>((at - num_shared_) / 3)] = false;
  while (num_used_ > num_shared_ && !is_taken_[static_cast<std::size_t>((num_used_ - num_shared_) / 3 - 1)])
    num_used_ -= 3;
  return true;
}

bool PoseChain::eliminate() {
  const Eigen::LLT<PoseMatrix> llt(A.topLeftCorner<pose_dim, pose_dim>());
  if (llt.info() != Eigen::Success) return false;
  Step step;
  step.index = num_poses_++;
  step.L = llt.matrixL();
  const auto L = llt.matrixL();
  step.W_poses = A.bottomLeftCorner<rest_dim, pose_dim>().transpose();
  step.W_border = U.topLeftCorner(pose_dim, num_used_);
  step.y = a.head<pose_dim>();
  L.solveInPlace(step.W_poses);
  L.solveInPlace(step.W_border);
  L.solveInPlace(step.y);
  const Eigen::Matrix<double, rest_dim, rest_dim> A_rest = A.bottomRightCorner<rest_dim, rest_dim>();
  const Eigen::Vector<double, rest_dim> a_rest = a.tail<rest_dim>();
  A.setZero();
  a.setZero();
  A.topLeftCorner<rest_dim, rest_dim>() = A_rest;
  a.head<rest_dim>() = a_rest;
  for (int j = 0; j < num_used_; ++j) {
    const Eigen::Vector<double, rest_dim> rest = U.col(j).tail<rest_dim>();
    U.col(j) << rest, Eigen::Vector<double, pose_dim>::Zero();
  }
  take_out(step);
  steps_.push_back(std::move(step));
  return true;
}

double PoseChain::gain() const {
  double sum = 0.0;
  for (const Step& step : steps_) sum += step.y.squaredNorm();
  return sum;
}

PoseChain::Steps PoseChain::steps(const Eigen::VectorXd& shared) const {
  Steps steps{std::vector<Eigen::Vector<double, pose_dim>>(num_poses_), std::vector<Eigen::Vector3d>(place_of_.size())};
  Eigen::Vector<double, rest_dim> after = Eigen::Vector<double, rest_dim>::Zero();
  Eigen::VectorXd border = Eigen::VectorXd::Zero(B.rows());
  border.head(num_shared_) = shared;
  for (std::size_t k = steps_.size(); k-- > 0;) {
    const Step& step = steps_[k];
    if (step.event == Event::entered) {
      border.segment<3>(step.place).setZero();
      continue;
    }
    const Eigen::VectorXd rhs = step.y - step.W_poses * after - step.W_border * border.head(step.W_border.cols());
    const Eigen::VectorXd x = step.L.transpose().triangularView<Eigen::Upper>().solve(rhs);
    if (step.event == Event::left) {
      steps.points[step.index] = border.segment<3>(step.place) = x;
      continue;
    }
    steps.poses[step.index] = x;
    after.tail<pose_dim>() = after.head<pose_dim>().eval();
    after.head<pose_dim>() = x;
  }
  return steps;
}

/// Forward substitution in order of elimination: returns y of each step; `border` gets the part of the shared
/// parameters.
std::vector<Eigen::MatrixXd> PoseChain::forward(const Columns& W, Eigen::MatrixXd& border) const {
  const Eigen::Index num_columns = W.poses.front().cols();
  border = Eigen::MatrixXd::Zero(B.rows(), num_columns);
  Eigen::MatrixXd poses = Eigen::MatrixXd::Zero(rest_dim, num_columns);  // of the window, except its first
  Eigen::MatrixXd first = Eigen::MatrixXd::Zero(pose_dim, num_columns);
  std::vector<Eigen::MatrixXd> y;
  for (const Step& step : steps_) {
    y.emplace_back();
    if (step.event == Event::entered) continue;
    if (step.event == Event::pose) {
      first = poses.topRows<pose_dim>() + W.poses[step.index];
      poses.topRows<pose_dim>() = poses.bottomRows<pose_dim>().eval();
      poses.bottomRows<pose_dim>().setZero();
    } else {
      first = border.middleRows<3>(step.place);
      if (!W.points.empty()) first += W.points[step.index];
      border.middleRows<3>(step.place).setZero();
    }
    y.back() = step.L.triangularView<Eigen::Lower>().solve(first);
    poses.noalias() -= step.W_poses.transpose() * y.back();
    border.topRows(step.W_border.cols()).noalias() -= step.W_border.transpose() * y.back();
  }
  return y;
}

PoseChain::Columns PoseChain::solve(const Columns& W, int num_solved) const {
  Eigen::MatrixXd border;
  const std::vector<Eigen::MatrixXd> y = forward(W, border);
  const Eigen::Index num_columns = W.poses.front().cols();
  Eigen::MatrixXd shared = Eigen::MatrixXd::Zero(B.rows(), num_columns);
  if (num_solved > 0) {
    shared.topRows(num_solved) = Llt(B.topLeftCorner(num_solved, num_solved)).solve_each(border.topRows(num_solved));
  }
  Columns columns{std::vector<Eigen::MatrixXd>(num_poses_), std::vector<Eigen::MatrixXd>(place_of_.size())};
  Eigen::MatrixXd after = Eigen::MatrixXd::Zero(rest_dim, num_columns);
  for (std::size_t k = steps_.size(); k-- > 0;) {
    const Step& step = steps_[k];
    if (step.event == Event::entered) {
      shared.middleRows<3>(step.place).setZero();
      continue;
    }
    const Eigen::MatrixXd rhs = y[k] - step.W_poses * after - step.W_border * shared.topRows(step.W_border.cols());
    const Eigen::MatrixXd x = step.L.transpose().triangularView<Eigen::Upper>().solve(rhs);
    if (step.event == Event::left) {
      columns.points[step.index] = shared.middleRows<3>(step.place) = x;
      continue;
    }
    columns.poses[step.index] = x;
    after.bottomRows<pose_dim>() = after.topRows<pose_dim>().eval();
    after.topRows<pose_dim>() = x;
  }
  return columns;
}

/// Covariance of the two remaining poses of the window and of the border, for the backward pass.
struct PoseChain::Backward {
  Eigen::Matrix<double, rest_dim, rest_dim> P = Eigen::Matrix<double, rest_dim, rest_dim>::Zero();
  Eigen::MatrixXd C;                                         ///< Of the border.
  Eigen::Matrix<double, Eigen::Dynamic, rest_dim> to_poses;  ///< Border by poses.
  Eigen::Matrix<double, rest_dim, Eigen::Dynamic> J;
  Eigen::MatrixXd J_border;

  /// An eliminated pose or point: its covariance, and cross-covariances with poses and border.
  struct Back {
    Eigen::MatrixXd cov, with_poses, with_border, J;
  };
  [[nodiscard]] Back back(const Step& step) const {
    const auto num = step.W_border.cols();
    const auto L_transposed = step.L.transpose().triangularView<Eigen::Upper>();
    Back out;
    out.with_poses = step.W_poses * P;
    out.with_poses.noalias() += step.W_border * to_poses.topRows(num);
    out.with_border = step.W_poses * to_poses.transpose();
    out.with_border.noalias() += step.W_border * C.topRows(num);
    Eigen::MatrixXd inner = out.with_poses * step.W_poses.transpose();
    inner.noalias() += out.with_border.leftCols(num) * step.W_border.transpose();
    inner.diagonal().array() += 1.0;
    const Eigen::MatrixXd half = L_transposed.solve(inner);
    const Eigen::MatrixXd cov = L_transposed.solve(half.transpose());
    out.cov = 0.5 * (cov + cov.transpose());
    out.J = -L_transposed.solve(step.W_poses * J + step.W_border * J_border.topRows(num));
    out.with_poses = -L_transposed.solve(out.with_poses);
    out.with_border = -L_transposed.solve(out.with_border);
    return out;
  }

  void take_back_point(const Step& step, const Back& back) {
    const int at = step.place;
    C.middleRows<3>(at) = back.with_border;
    C.middleCols<3>(at) = back.with_border.transpose();
    C.block<3, 3>(at, at) = back.cov;
    to_poses.middleRows<3>(at) = back.with_poses;
    J_border.middleRows<3>(at) = back.J;
  }

  void take_back_pose(const Back& back) {
    P.bottomRightCorner<pose_dim, pose_dim>() = P.topLeftCorner<pose_dim, pose_dim>().eval();
    P.topLeftCorner<pose_dim, pose_dim>() = back.cov;
    P.topRightCorner<pose_dim, pose_dim>() = back.with_poses.leftCols<pose_dim>();
    P.bottomLeftCorner<pose_dim, pose_dim>() = P.topRightCorner<pose_dim, pose_dim>().transpose();
    to_poses.rightCols<pose_dim>() = to_poses.leftCols<pose_dim>().eval();
    to_poses.leftCols<pose_dim>() = back.with_border.transpose();
    J.bottomRows<pose_dim>() = J.topRows<pose_dim>().eval();
    J.topRows<pose_dim>() = back.J;
  }

  /// Clears a point before the step at which it entered.
  void forget_point(int at) {
    C.middleRows<3>(at).setZero();
    C.middleCols<3>(at).setZero();
    to_poses.middleRows<3>(at).setZero();
    J_border.middleRows<3>(at).setZero();
  }
};

PoseChain::Spread PoseChain::spread(const Eigen::MatrixXd& shared_cov, const Eigen::MatrixXd& J_shared) const {
  Spread spread;
  spread.cov.resize(num_poses_);
  spread.J.resize(num_poses_);
  spread.point_cov.resize(place_of_.size(), Eigen::Matrix3d::Zero());
  spread.point_J.resize(place_of_.size());
  Backward now;
  now.C = Eigen::MatrixXd::Zero(B.rows(), B.rows());
  now.C.topLeftCorner(num_shared_, num_shared_) = shared_cov;
  now.to_poses.setZero(B.rows(), rest_dim);
  now.J.setZero(rest_dim, J_shared.cols());
  now.J_border = Eigen::MatrixXd::Zero(B.rows(), J_shared.cols());
  now.J_border.topRows(num_shared_) = J_shared;
  for (std::size_t k = steps_.size(); k-- > 0;) {
    const Step& step = steps_[k];
    if (step.event == Event::entered) {
      now.forget_point(step.place);
      continue;
    }
    const Backward::Back back = now.back(step);
    if (step.event == Event::left) {
      now.take_back_point(step, back);
      spread.point_cov[step.index] = back.cov;
      spread.point_J[step.index] = back.J;
      continue;
    }
    now.take_back_pose(back);
    spread.cov[step.index] = back.cov;
    spread.J[step.index] = back.J;
  }
  return spread;
}

}  // namespace alidade
