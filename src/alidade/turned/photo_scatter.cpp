#include "alidade/turned/photo_scatter.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Camera6 = TurnedCamera;

/// Projection on the positive semidefinite matrices.
TurnedInformation positive_part(const TurnedInformation& M) {
  const SymmetricEigen eigen = symmetric_eigen(Eigen::MatrixXd(0.5 * (M + M.transpose())));
  return eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose();
}

/// Covariance of the model plus the excess scatter of the photos, whitened by the model's.
TurnedInformation with_scatter(const TurnedInformation& seen, const TurnedInformation& expected, double n,
                               const ScatterCovariance& scatter) {
  const double shrink = std::min(1.0, 8.0 / n);
  const double excess = std::max(scatter.design_effect - 1.0, 0.0);
  const TurnedInformation added =
      shrink * excess * expected + (1.0 - shrink) * positive_part(TurnedInformation(seen - expected));
  const double nu = std::max(scatter.degrees_of_freedom, 4.0);
  return TurnedInformation::Identity() + nu / (nu - 2.0) * added;
}

}  // namespace

ScatterCovariance scatter_covariance(const TurnedFit& fit, const Progress& progress) {
  const Eigen::MatrixXd cov = inverse_symmetric(turned_normal(fit.bundle, fit.prior, fit.solve).information);
  ScatterCovariance scatter;
  scatter.cov_model = cov.topLeftCorner<num_camera, num_camera>();
  const Llt root(scatter.cov_model);
  const auto whitened = [&](const TurnedInformation& M) {
    return TurnedInformation(root.whitened(root.whitened(M).transpose()));
  };
  const auto count = fit.bundle.cam_from_world.size();
  TurnedInformation seen = TurnedInformation::Zero(), expected = TurnedInformation::Zero();
  double sum = 0.0, sum2 = 0.0;
  for (std::size_t k = 0; k < count; ++k) {
    report_progress(progress, "held-out photos", k, count);
    const TurnedNormal without = turned_normal(fit.bundle, fit.prior, fit.solve, static_cast<int>(k));
    Eigen::MatrixXd information = without.information;
    information.diagonal().array() += 1e-6;  // a photo without links may rotate freely
    const Eigen::MatrixXd cov_without = inverse_symmetric(information);
    const Camera6 change = root.whitened(Camera6(-(cov_without * without.gradient).head<num_camera>()));
    seen += change * change.transpose();
    const TurnedInformation cov_of_others = cov_without.topLeftCorner<num_camera, num_camera>();
    const TurnedInformation of_model = whitened(TurnedInformation(cov_of_others - scatter.cov_model));
    expected += of_model;
    scatter.z2.push_back(of_model.trace() > 0.0 ? change.squaredNorm() / of_model.trace() : 1.0);
    sum += change.squaredNorm();
    sum2 += change.squaredNorm() * change.squaredNorm();
  }
  const double n = static_cast<double>(count);
  seen *= (n - 1.0) / n;
  expected = positive_part(expected);
  scatter.design_effect = expected.trace() > 0.0 ? seen.trace() / expected.trace() : 1.0;
  scatter.degrees_of_freedom = sum2 > 0.0 ? std::max(sum * sum / sum2, 2.0) : n;
  const TurnedInformation L = root.lower();
  scatter.cov = L * with_scatter(seen, expected, n, scatter) * L.transpose();
  return scatter;
}

double three_sigma_of(int term, const ScatterCovariance& scatter) {
  const double share = 1.0 - std::min(scatter.cov_model(term, term) / scatter.cov(term, term), 1.0);
  const double nu = std::max(scatter.degrees_of_freedom, 4.0) / std::max(share * share, 1e-6);
  const double t = 3.0 + 7.5 / nu + 17.25 / (nu * nu) + 30.2 / (nu * nu * nu);
  return t * std::sqrt((nu - 2.0) / nu);
}

bool is_nearly_zero(int term, const TurnedFit& fit, const ScatterCovariance& scatter) {
  return std::abs(fit.bundle.camera[term]) <= three_sigma_of(term, scatter) * std::sqrt(scatter.cov(term, term));
}

}  // namespace alidade
