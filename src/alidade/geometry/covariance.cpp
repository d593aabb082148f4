#include "alidade/geometry/covariance.h"

#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {

bool is_covariance(const Eigen::MatrixXd& cov, double rounding) {
  if (cov.size() == 0) return true;
  if (cov.rows() != cov.cols() || !cov.allFinite() || cov.diagonal().minCoeff() < 0.0) return false;
  const Eigen::VectorXd scale =
      cov.diagonal().unaryExpr([](double variance) { return variance > 0.0 ? 1.0 / std::sqrt(variance) : 0.0; });
  const Eigen::MatrixXd correlation = scale.asDiagonal() * cov * scale.asDiagonal();
  if ((correlation - correlation.transpose()).cwiseAbs().maxCoeff() > rounding) return false;
  return symmetric_eigenvalues(correlation).minCoeff() > -rounding;
}

}  // namespace alidade
