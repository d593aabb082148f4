#include "alidade/report/ellipse.h"

#include <Eigen/Eigenvalues>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>
#include <vector>

namespace alidade::report {

void append_ellipse(std::string& d, Place centre, const Eigen::Matrix2d& cov, double sigmas) {
  constexpr int pieces = 48;
  constexpr double farthest = 1e5;  // paper units
  if (!cov.allFinite()) return;
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d> solver(cov);
  const Eigen::Vector2d radii = sigmas * solver.eigenvalues().cwiseMax(0.0).cwiseSqrt();
  if (!(radii.maxCoeff() > 0.0) || !(radii.maxCoeff() < farthest)) return;
  std::vector<Place> places;
  for (int i = 0; i < pieces; ++i) {
    const double turn = 2.0 * std::numbers::pi * i / pieces;
    const Eigen::Vector2d offset =
        solver.eigenvectors() * radii.cwiseProduct(Eigen::Vector2d(std::cos(turn), std::sin(turn)));
    places.push_back({centre.x + offset.x(), centre.y + offset.y()});
  }
  append_polyline(d, places, true);
}

double larger_sigma(const Eigen::Matrix2d& cov) {
  if (!cov.allFinite()) return std::numeric_limits<double>::quiet_NaN();
  return std::sqrt(
      std::max(0.0, Eigen::SelfAdjointEigenSolver<Eigen::Matrix2d>(cov, Eigen::EigenvaluesOnly).eigenvalues().y()));
}

}  // namespace alidade::report
