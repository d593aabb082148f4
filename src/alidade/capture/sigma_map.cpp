#include "alidade/capture/sigma_map.h"

#include <algorithm>
#include <cmath>

#include "alidade/camera/implied_motion.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

SigmaMap::SigmaMap(const Camera& camera, const std::vector<int>& free, int cols, int rows) {
  const PixelGrid grid = make_grid(camera.width_px, camera.height_px, cols, rows);
  const auto seen = detail::look(camera, grid, std::numeric_limits<double>::infinity());
  std::vector<double> sigmas_px;
  for (const auto& cov : detail::implied_covariance(camera.cov, seen, std::vector<double>(seen.size(), 1.0), 0.0))
    sigmas_px.push_back(detail::largest_sigma(cov));
  const std::vector<double> weights = detail::inverse_variance_weights(sigmas_px);

  const auto num_free = static_cast<Eigen::Index>(free.size());
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(3, num_free);
  std::vector<Eigen::Matrix<double, 2, 3>> by_motion;
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    Eigen::Matrix<double, 2, Eigen::Dynamic> by_lens(2, num_free);
    for (Eigen::Index j = 0; j < num_free; ++j)
      by_lens.col(j) = seen[i]->projection.J_px_params.col(free[static_cast<std::size_t>(j)]);
    by_motion.emplace_back(detail::motion_jacobian(*seen[i], 0.0));
    A += weights[i] * by_motion.back().transpose() * by_motion.back();
    B += weights[i] * by_motion.back().transpose() * by_lens;
    derivatives_.push_back(std::move(by_lens));
    pixels_.push_back(grid.px(static_cast<int>(i) % cols, static_cast<int>(i) / cols));
  }
  const Eigen::MatrixXd K = -minimum_norm_solution(A, B);
  for (std::size_t i = 0; i < derivatives_.size(); ++i) derivatives_[i] += by_motion[i] * K;
}

SigmaMap::Summary SigmaMap::of(const Eigen::MatrixXd& cov) const {
  Summary summary;
  double sum = 0.0;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> G;
  for (std::size_t i = 0; i < derivatives_.size(); ++i) {
    G.noalias() = derivatives_[i].lazyProduct(cov);
    const double uu = G.row(0).dot(derivatives_[i].row(0)), uv = G.row(0).dot(derivatives_[i].row(1));
    const double vv = G.row(1).dot(derivatives_[i].row(1));
    const double variance = 0.5 * (uu + vv) + std::hypot(0.5 * (uu - vv), uv);
    sum += variance;
    if (!(variance > summary.worst_px)) continue;
    summary.worst_px = variance;
    summary.at = i;
  }
  summary.worst_px = std::sqrt(std::max(0.0, summary.worst_px));
  summary.rms_px = std::sqrt(sum / static_cast<double>(std::max<std::size_t>(1, derivatives_.size())));
  return summary;
}

}  // namespace alidade
