#include "alidade/network/path_spline.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {

std::optional<PathSpline::Support> PathSpline::support(double t_s) const {
  const double at = (t_s - from_s) / knot_s;
  if (!(at >= 0.0) || !(at < static_cast<double>(control.size()) - 3.0)) return std::nullopt;
  Support support;
  support.first = static_cast<std::size_t>(at);
  const double u = at - std::floor(at), v = 1.0 - u;
  support.weight = {v * v * v / 6.0, (3.0 * u * u * u - 6.0 * u * u + 4.0) / 6.0,
                    (-3.0 * u * u * u + 3.0 * u * u + 3.0 * u + 1.0) / 6.0, u * u * u / 6.0};
  support.rate = {-0.5 * v * v / knot_s, (1.5 * u * u - 2.0 * u) / knot_s, (-1.5 * u * u + u + 0.5) / knot_s,
                  0.5 * u * u / knot_s};
  return support;
}

Eigen::Vector3d PathSpline::position(const Support& at) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) sum += at.weight[k] * control[at.first + k];
  return sum;
}

Eigen::Vector3d PathSpline::velocity(const Support& at) const {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t k = 0; k < 4; ++k) sum += at.rate[k] * control[at.first + k];
  return sum;
}

PathSystem::PathSystem(std::size_t num_control, Eigen::Index num_common) {
  const auto n = static_cast<Eigen::Index>(3 * num_control);
  A_.setZero(n, band);
  W_.setZero(n, num_common);
  U_.setZero(num_common, num_common);
  path_.setZero(n);
  common_.setZero(num_common);
}

void PathSystem::add(std::size_t first_control, const Eigen::Matrix<double, 2, 12>& J_path, const Eigen::Vector2d& r,
                     Eigen::Index first_common, const Eigen::MatrixXd& J_common) {
  const auto at = static_cast<Eigen::Index>(3 * first_control);
  const Eigen::Matrix<double, 12, 12> JtJ = J_path.transpose() * J_path;
  for (Eigen::Index i = 0; i < band; ++i)
    for (Eigen::Index k = 0; k <= i; ++k) A_(at + i, i - k) += JtJ(i, k);
  path_.segment<12>(at) -= J_path.transpose() * r;
  const Eigen::Index num = J_common.cols();
  if (num == 0) return;
  // Two rows: coefficient by coefficient, since a blocked product packs more than it multiplies.
  W_.block(at, first_common, 12, num) += J_path.transpose().lazyProduct(J_common);
  U_.block(first_common, first_common, num, num) += J_common.transpose().lazyProduct(J_common);
  common_.segment(first_common, num) -= J_common.transpose().lazyProduct(r);
}

void PathSystem::add_bend(std::span<const Eigen::Vector3d> control, std::size_t k, double weight) {
  static constexpr std::array<double, 3> stencil{1.0, -2.0, 1.0};
  const Eigen::Vector3d r = weight * (control[k - 1] - 2.0 * control[k] + control[k + 1]);
  const auto first = static_cast<Eigen::Index>(3 * (k - 1));
  for (Eigen::Index i = 0; i < 3; ++i) {
    const double J_i = weight * stencil[static_cast<std::size_t>(i)];
    for (Eigen::Index axis = 0; axis < 3; ++axis) {
      const Eigen::Index row = first + 3 * i + axis;
      for (Eigen::Index j = 0; j <= i; ++j) A_(row, 3 * (i - j)) += J_i * weight * stencil[static_cast<std::size_t>(j)];
      path_[row] -= J_i * r[axis];
    }
  }
}

void PathSystem::add_common(const Eigen::VectorXd& J_common, double r) {
  U_ += J_common * J_common.transpose();
  common_ -= J_common * r;
}

bool PathSystem::factor(double damping) {
  L_ = A_;
  L_.col(0) *= 1.0 + damping;
  for (Eigen::Index i = 0; i < L_.rows(); ++i) {
    const Eigen::Index lowest = std::max<Eigen::Index>(0, i - band + 1);
    for (Eigen::Index k = lowest; k <= i; ++k) {
      double sum = L_(i, i - k);
      for (Eigen::Index m = lowest; m < k; ++m)
        if (k - m < band) sum -= L_(i, i - m) * L_(k, k - m);
      if (k < i) {
        L_(i, i - k) = sum / L_(k, 0);
      } else {
        if (!(sum > 1e-14 * A_(i, 0)) || !(sum > 0.0)) return false;
        L_(i, 0) = std::sqrt(sum);
      }
    }
  }
  return true;
}

std::optional<PathSystem::Step> PathSystem::solve(double damping) {
  if (!factor(damping)) return std::nullopt;
  const Eigen::Index n = L_.rows();
  Y_ = W_;
  Eigen::VectorXd y = path_;
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index d = 1; d < band && d <= i; ++d) {
      Y_.row(i) -= L_(i, d) * Y_.row(i - d);
      y[i] -= L_(i, d) * y[i - d];
    }
    Y_.row(i) /= L_(i, 0);
    y[i] /= L_(i, 0);
  }
  Eigen::MatrixXd U = U_;
  U.diagonal() *= 1.0 + damping;
  information_ = U - Y_.transpose() * Y_;
  Step step;
  if (information_.rows() > 0) {
    const Ldlt ldlt(information_);
    if (!ldlt.is_positive()) return std::nullopt;
    step.common = ldlt.solve(common_ - Y_.transpose() * y);
    y -= Y_ * step.common;
  }
  for (Eigen::Index i = n; i-- > 0;) {
    for (Eigen::Index d = 1; d < band && i + d < n; ++d) y[i] -= L_(i + d, d) * y[i + d];
    y[i] /= L_(i, 0);
  }
  step.path = y;
  if (!step.path.allFinite() || !step.common.allFinite()) return std::nullopt;
  return step;
}

Eigen::MatrixXd PathSystem::path_by_common() const {
  Eigen::MatrixXd Z = Y_;
  for (Eigen::Index i = Z.rows(); i-- > 0;) {
    for (Eigen::Index d = 1; d < band && i + d < Z.rows(); ++d) Z.row(i) -= L_(i + d, d) * Z.row(i + d);
    Z.row(i) /= L_(i, 0);
  }
  return Z;
}

}  // namespace alidade
