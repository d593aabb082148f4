#include "alidade/observe/filters/difference_filter.h"

namespace alidade {
namespace {

/// Variance of an unknown position in squared scaled pixels: many image widths.
constexpr double diffuse_variance = 100.0;

}  // namespace

DifferenceFilter::DifferenceFilter(std::size_t num_points, const LinearInformation<8>& theta, double variance)
    : theta_(theta), variance_(variance) {
  const auto n = static_cast<Eigen::Index>(num_points);
  a_ = Eigen::Matrix2Xd::Zero(2, n);
  b_ = Eigen::Matrix<double, 8, Eigen::Dynamic>::Zero(8, 2 * n);
  c_ = Eigen::MatrixXd::Zero(n, n);
  covariance_ = gain_ = Eigen::VectorXd::Zero(n);
}

void DifferenceFilter::begin(Eigen::Index reference) {
  reference_ = reference;
  restart(reference, Eigen::Vector2d::Zero());
  c_(reference, reference) = variance_;
  theta_.begin();
}

void DifferenceFilter::move(Eigen::Index point, const DifferenceRegressor& h_omega, double drift_variance) {
  b_.middleCols<2>(2 * point) += h_omega;
  c_(point, point) += drift_variance;
}

void DifferenceFilter::restart(Eigen::Index point, const Eigen::Vector2d& y) {
  a_.col(point) = y;
  b_.middleCols<2>(2 * point).setZero();
  c_.row(point).setZero();
  c_.col(point).setZero();
  c_(point, point) = diffuse_variance;
}

void DifferenceFilter::measure(Eigen::Index point, const Eigen::Vector2d& y) {
  covariance_ = c_.col(point) - c_.col(reference_);
  const double innovation_variance = covariance_[point] - covariance_[reference_] + variance_;
  gain_ = covariance_ / innovation_variance;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const DifferenceParameters beta = b_.col(2 * point + axis) - b_.col(2 * reference_ + axis);
    const double innovation = y[axis] - (a_(axis, point) - a_(axis, reference_));
    theta_.add(beta, innovation, innovation_variance);
    for (Eigen::Index i = 0; i < gain_.size(); ++i) {
      a_(axis, i) += gain_[i] * innovation;
      b_.col(2 * i + axis) -= gain_[i] * beta;
    }
  }
  c_.noalias() -= gain_ * covariance_.transpose();
}

}  // namespace alidade
