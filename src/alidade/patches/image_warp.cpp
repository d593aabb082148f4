#include "alidade/patches/image_warp.h"
#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

#include <algorithm>
#include <limits>
#include <utility>
#include <vector>

namespace alidade {
namespace {

constexpr std::size_t min_points = 20;  // twice the number of terms

}  // namespace

ImageWarp::Terms ImageWarp::terms(const Eigen::Vector2d& q) {
  const double x = q.x(), y = q.y();
  return (Terms() << 1.0, x, y, x * x, x * y, y * y, x * x * x, x * x * y, x * y * y, y * y * y).finished();
}

std::optional<ImageWarp> ImageWarp::fit(std::span<const PointMove> moves) {
  if (moves.size() < min_points) return std::nullopt;
  ImageWarp warp;
  Eigen::Vector2d low = moves[0].from_px, high = low;
  for (const PointMove& move : moves) {
    low = low.cwiseMin(move.from_px);
    high = high.cwiseMax(move.from_px);
  }
  warp.centre_ = 0.5 * (low + high);
  warp.scale_ = std::max(0.5 * (high - low).maxCoeff(), 1.0);
  if (!warp.solve(moves, std::numeric_limits<double>::infinity())) return std::nullopt;
  // Half of the points are assumed good; of the others, those that fit equally well.
  std::vector<double> residuals;
  for (const PointMove& move : moves) residuals.push_back((warp.at(move.from_px) - move.to_px).norm());
  constexpr double of_median = 4.0;
  if (!warp.solve(moves, of_median * median_of(std::move(residuals)) + 1e-6)) return std::nullopt;
  return warp;
}

bool ImageWarp::solve(std::span<const PointMove> moves, double max_residual_px) {
  Eigen::Matrix<double, num_terms, num_terms> normal = Eigen::Matrix<double, num_terms, num_terms>::Zero();
  Eigen::Matrix<double, num_terms, 2> right = Eigen::Matrix<double, num_terms, 2>::Zero();
  std::size_t used = 0;
  for (const PointMove& move : moves) {
    const Terms row = terms(normalised(move.from_px));
    if ((coefficients_.transpose() * row - move.to_px).norm() > max_residual_px) continue;
    normal.selfadjointView<Eigen::Lower>().rankUpdate(row);
    right += row * move.to_px.transpose();
    ++used;
  }
  const Ldlt factors(normal);
  // Points on a cubic curve do not determine the polynomial: pivots below 10⁻⁸ of the largest indicate this.
  const bool is_open = factors.pivots().minCoeff() < 1e-8 * factors.pivots().maxCoeff();
  if (used < min_points || is_open) return false;
  coefficients_ = factors.solve_each(right);
  return coefficients_.allFinite();
}

Eigen::Vector2d ImageWarp::at(const Eigen::Vector2d& px) const {
  return coefficients_.transpose() * terms(normalised(px));
}

WarpBend ImageWarp::bend_at(const Eigen::Vector2d& px) const {
  const Eigen::Vector2d q = normalised(px);
  const auto c = [&](int term) { return Eigen::Vector2d(coefficients_.row(term)); };
  WarpBend bend;
  bend << 2.0 * c(3) + 6.0 * q.x() * c(6) + 2.0 * q.y() * c(7), c(4) + 2.0 * q.x() * c(7) + 2.0 * q.y() * c(8),
      2.0 * c(5) + 2.0 * q.x() * c(8) + 6.0 * q.y() * c(9);
  return bend / (scale_ * scale_);
}

}  // namespace alidade
