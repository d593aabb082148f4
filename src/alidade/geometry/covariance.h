#pragma once

#include <Eigen/Core>

namespace alidade {

/// Whether a matrix can be a covariance: symmetric, finite, and no combination of its parameters of negative variance,
/// to the rounding of its correlations. The empty one can.
[[nodiscard]] bool is_covariance(const Eigen::MatrixXd& cov, double rounding = 1e-4);

}  // namespace alidade
