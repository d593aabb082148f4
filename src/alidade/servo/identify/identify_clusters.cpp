#include "alidade/servo/identify/identify_clusters.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

using Eigen::Index;

/// Σ r_i r_{i+k} / (n − 5): with n in place of n − k no spectrum of it is negative.
double autocovariance(std::span<const double> residual_rad, std::size_t lag) {
  double sum = 0.0;
  for (std::size_t i = 0; i + lag < residual_rad.size(); ++i) sum += residual_rad[i] * residual_rad[i + lag];
  return sum / std::max(1.0, static_cast<double>(residual_rad.size()) - num_servo_params);
}

}  // namespace

std::size_t correlated_rows(std::span<const double> residual_rad) {
  const double none = autocovariance(residual_rad, 0) * 2.0 / std::sqrt(static_cast<double>(residual_rad.size()));
  const std::size_t most = std::max<std::size_t>(1, residual_rad.size() / 4);
  std::size_t lag = 1;
  while (lag < most && autocovariance(residual_rad, lag) > none) ++lag;
  return lag;
}

ClusterCovariance servo_clusters(std::span<const double> residual_rad, const Eigen::MatrixXd& J,
                                 const Eigen::MatrixXd& inverse) {
  constexpr std::size_t min_rows = 4, min_blocks = 8;
  const std::size_t rows = residual_rad.size();
  const std::size_t length =
      std::clamp(2 * correlated_rows(residual_rad), min_rows, std::max(min_rows, rows / min_blocks));
  const auto size = static_cast<Index>(length);
  Eigen::MatrixXd noise(size, size);
  for (Index k = 0; k < size; ++k) {
    const double value = autocovariance(residual_rad, static_cast<std::size_t>(k));
    noise.diagonal(k).setConstant(value);
    noise.diagonal(-k).setConstant(value);
  }
  std::vector<ClusterStep> steps;
  Eigen::MatrixXd model = Eigen::MatrixXd::Zero(J.cols(), J.cols());
  for (std::size_t first = 0; first < rows; first += length) {
    const auto at = static_cast<Index>(first), num = static_cast<Index>(std::min(length, rows - first));
    const Eigen::MatrixXd own = J.middleRows(at, num) * inverse;
    const Eigen::Map<const Eigen::VectorXd> residual(residual_rad.data() + at, num);
    steps.push_back({own.transpose() * residual, own.transpose() * noise.topLeftCorner(num, num) * own});
    model += steps.back().spread;
  }
  return cluster_covariance(model, 1.0, steps);
}

}  // namespace alidade
