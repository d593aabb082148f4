#include "alidade/camera/projection_sigma.h"

#include <cmath>
#include <limits>

#include "alidade/camera/implied_motion.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"

namespace alidade {

PixelGrid make_grid(int width_px, int height_px, int cols, int rows) {
  const double last_u = width_px - 1, last_v = height_px - 1;
  PixelGrid grid{cols, rows, 0.0, 0.0, 1.0, 1.0, {}};
  if (cols > 1) grid.du_px = last_u / (cols - 1);
  if (rows > 1) grid.dv_px = last_v / (rows - 1);
  if (cols == 1) grid.u0_px = 0.5 * last_u;
  if (rows == 1) grid.v0_px = 0.5 * last_v;
  return grid;
}

namespace detail {

namespace {

std::vector<Eigen::Vector2d> pixels_of(const PixelGrid& grid) {
  std::vector<Eigen::Vector2d> pixels;
  for (int row = 0; row < grid.rows; ++row) {
    for (int col = 0; col < grid.cols; ++col) pixels.push_back(grid.px(col, row));
  }
  return pixels;
}

std::vector<std::optional<GridPoint>> look_at(const Camera& camera, std::span<const Eigen::Vector2d> pixels,
                                              double distance_m) {
  const std::vector<std::optional<ObservationRay>> rays = observation_rays(camera, pixels);
  // Infinity is a direction to a central lens; to another, a point so far away that its origin no longer counts.
  const double far_m = is_central(camera.lens) ? 1.0 : 1e6;
  const double range_m = std::isfinite(distance_m) ? distance_m : far_m;
  std::vector<Eigen::Vector3d> points_in_cam;
  for (const auto& ray : rays) {
    const auto point_in_cam = ray ? point_at_range(*ray, range_m) : std::nullopt;
    points_in_cam.push_back(point_in_cam.value_or(Eigen::Vector3d::Zero()));
  }
  const std::vector<std::optional<LensProjection>> projections = project_with_jacobians(camera, points_in_cam);
  std::vector<std::optional<GridPoint>> seen(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (rays[i] && projections[i]) seen[i] = GridPoint{points_in_cam[i], *projections[i]};
  }
  return seen;
}

/// 1/σ² of each pixel that is seen, by the σ of an unweighted fit.
std::vector<double> weights_of(const Eigen::MatrixXd& cov, std::span<const std::optional<GridPoint>> seen,
                               double range_m) {
  std::vector<double> sigmas_px;
  for (const Eigen::Matrix2d& each : implied_covariance(cov, seen, std::vector<double>(seen.size(), 1.0), range_m)) {
    sigmas_px.push_back(largest_sigma(each));
  }
  return inverse_variance_weights(sigmas_px);
}

bool has_full_covariance(const Camera& camera) {
  return camera.cov.rows() == params(camera.lens).size() && camera.cov.cols() == camera.cov.rows();
}

}  // namespace

std::vector<std::optional<GridPoint>> look(const Camera& camera, const PixelGrid& grid, double distance_m) {
  return look_at(camera, pixels_of(grid), distance_m);
}

std::vector<double> sigma_at(const Camera& camera, std::span<const Eigen::Vector2d> pixels, double distance_m) {
  std::vector<double> sigmas_px(pixels.size(), std::numeric_limits<double>::quiet_NaN());
  if (!has_full_covariance(camera)) return sigmas_px;
  const double range_m = std::isfinite(distance_m) ? distance_m : 0.0;
  std::vector<std::optional<GridPoint>> seen =
      look(camera, make_grid(camera.width_px, camera.height_px, 60, 40), distance_m);
  std::vector<double> weights = weights_of(camera.cov, seen, range_m);
  const std::size_t num_grid = seen.size();
  for (auto& each : look_at(camera, pixels, distance_m)) seen.push_back(std::move(each));
  weights.resize(seen.size(), 0.0);  // they do not take part in the fit of the motion
  const auto covariances = implied_covariance(camera.cov, seen, weights, range_m);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    if (seen[num_grid + i]) sigmas_px[i] = largest_sigma(covariances[num_grid + i]);
  }
  return sigmas_px;
}

MotionJacobian motion_jacobian(const GridPoint& at, double range_m) {
  const bool with_translation = range_m > 0.0;
  MotionJacobian J(2, with_translation ? 6 : 3);
  J.rightCols<3>() = -at.projection.J_px_point * cross_matrix(at.point_in_cam);
  if (with_translation) J.leftCols<3>() = at.projection.J_px_point * range_m;
  return J;
}

std::vector<Eigen::Matrix2d> implied_covariance(const Eigen::MatrixXd& cov,
                                                std::span<const std::optional<GridPoint>> seen,
                                                std::span<const double> weights, double range_m) {
  const Eigen::Index num_motion = range_m > 0.0 ? 6 : 3;
  Eigen::MatrixXd A = Eigen::MatrixXd::Zero(num_motion, num_motion);
  Eigen::MatrixXd B = Eigen::MatrixXd::Zero(num_motion, cov.cols());
  std::vector<MotionJacobian> J_motion(seen.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    J_motion[i] = motion_jacobian(*seen[i], range_m);
    A.noalias() += weights[i] * J_motion[i].transpose() * J_motion[i];
    B.noalias() += weights[i] * J_motion[i].transpose() * seen[i]->projection.J_px_params;
  }
  // The least-norm answer where the grid does not determine the motion (a very narrow image).
  const Eigen::MatrixXd K = -minimum_norm_solution(A, B);
  std::vector<Eigen::Matrix2d> covariances(seen.size(), Eigen::Matrix2d::Zero());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    const Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> G = seen[i]->projection.J_px_params + J_motion[i] * K;
    covariances[i].noalias() = G * (cov * G.transpose());
  }
  return covariances;
}

double largest_sigma(const Eigen::Matrix2d& cov) {
  const double mean = 0.5 * cov.trace(), half_difference = 0.5 * (cov(0, 0) - cov(1, 1));
  return std::sqrt(std::max(0.0, mean + std::hypot(half_difference, 0.5 * (cov(0, 1) + cov(1, 0)))));
}

std::vector<double> inverse_variance_weights(std::span<const double> sigmas_px) {
  double largest = 0.0;
  for (const double sigma_px : sigmas_px) {
    if (sigma_px > largest) largest = sigma_px;
  }
  std::vector<double> weights(sigmas_px.size(), 1.0);
  if (!(largest > 0.0)) return weights;
  const double floor = 1e-4 * largest * largest;  // no pixel counts more than 10⁴ times another
  for (std::size_t i = 0; i < weights.size(); ++i) weights[i] = 1.0 / (floor + sigmas_px[i] * sigmas_px[i]);
  return weights;
}

}  // namespace detail

PixelGrid projection_sigma(const Camera& camera, int cols, int rows, double distance_m) {
  PixelGrid grid = make_grid(camera.width_px, camera.height_px, cols, rows);
  const std::size_t num_pixels = static_cast<std::size_t>(cols) * static_cast<std::size_t>(rows);
  grid.values.assign(num_pixels, std::numeric_limits<double>::quiet_NaN());
  if (!detail::has_full_covariance(camera)) return grid;

  const double range_m = std::isfinite(distance_m) ? distance_m : 0.0;
  const std::vector<std::optional<detail::GridPoint>> seen = detail::look(camera, grid, distance_m);
  const auto covariances =
      detail::implied_covariance(camera.cov, seen, detail::weights_of(camera.cov, seen, range_m), range_m);
  for (std::size_t i = 0; i < num_pixels; ++i) {
    if (seen[i]) grid.values[i] = detail::largest_sigma(covariances[i]);
  }
  return grid;
}

}  // namespace alidade
