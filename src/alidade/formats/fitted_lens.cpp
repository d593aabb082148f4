#include <Eigen/Core>
#include <cmath>
#include <limits>

#include "alidade/camera/projection_sigma.h"
#include "alidade/formats/camera_file.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

struct SeenRay {
  Eigen::Vector2d px;
  Eigen::Vector3d ray;
};

std::vector<SeenRay> rays_over_image(const Camera& camera) {
  constexpr int cols = 40, rows = 30;
  const PixelGrid grid = make_grid(camera.width_px, camera.height_px, cols, rows);
  std::vector<SeenRay> rays;
  for (int row = 0; row < rows; ++row)
    for (int col = 0; col < cols; ++col)
      if (const auto ray = unproject(camera, grid.px(col, row))) rays.push_back({grid.px(col, row), *ray});
  return rays;
}

/// Sum of squares [px²]; a ray that the lens does not see counts as one that is a whole image off.
double misfit(const Camera& camera, const std::vector<SeenRay>& rays) {
  double sum = 0.0;
  for (const SeenRay& seen : rays) {
    const auto px = project(camera, seen.ray);
    sum += px ? (*px - seen.px).squaredNorm() : std::pow(camera.width_px, 2);
  }
  return sum;
}

Eigen::VectorXd gauss_newton_step(const Camera& camera, const std::vector<SeenRay>& rays,
                                  const std::vector<Eigen::Index>& free) {
  Eigen::MatrixXd J =
      Eigen::MatrixXd::Zero(2 * static_cast<Eigen::Index>(rays.size()), static_cast<Eigen::Index>(free.size()));
  Eigen::VectorXd r = Eigen::VectorXd::Zero(J.rows());
  for (std::size_t i = 0; i < rays.size(); ++i) {
    const auto seen = project_with_jacobians(camera, rays[i].ray);
    if (!seen) continue;
    const Eigen::Index row = 2 * static_cast<Eigen::Index>(i);
    r.segment<2>(row) = rays[i].px - seen->px;
    for (std::size_t k = 0; k < free.size(); ++k)
      J.block<2, 1>(row, static_cast<Eigen::Index>(k)) = seen->J_px_params.col(free[k]);
  }
  Eigen::VectorXd step = Eigen::VectorXd::Zero(params(camera.lens).size());
  const Eigen::VectorXd solved = least_squares(J, r);
  for (std::size_t k = 0; k < free.size(); ++k) step[free[k]] = solved[static_cast<Eigen::Index>(k)];
  return step;
}

/// Fits the free parameters of `camera`, step by step as long as it gains.
void fit(Camera& camera, const std::vector<SeenRay>& rays, const std::vector<Eigen::Index>& free) {
  constexpr int max_steps = 30;
  double last = misfit(camera, rays);
  for (int step = 0; step < max_steps; ++step) {
    const Eigen::VectorXd by = gauss_newton_step(camera, rays, free);
    double share = 1.0, now = last;
    Camera moved = camera;
    for (; share > 1e-3; share *= 0.5) {
      moved.lens = with_params(camera.lens, params(camera.lens) + share * by);
      now = misfit(moved, rays);
      if (now < last) break;
    }
    if (!(now < last)) return;
    camera = moved;
    if (now > (1.0 - 1e-9) * last) return;
    last = now;
  }
}

}  // namespace

FittedLens fitted_lens(const Camera& camera, CameraFormat format) {
  FittedLens fitted{camera};
  if (lens_losses(camera, format).empty()) return fitted;
  const bool drops_k3 = format == CameraFormat::kalibr && std::holds_alternative<Calibrated<Brown>>(camera.lens);
  Eigen::VectorXd values = params(camera.lens);
  std::vector<Eigen::Index> free;
  for (Eigen::Index i = 0; i < values.size(); ++i) {
    const bool is_dropped = i == 4 || (i == 9 && drops_k3);  // skew, k3
    if (is_dropped) values[i] = 0.0;
    if (!is_dropped) free.push_back(i);
  }
  fitted.camera.lens = with_params(camera.lens, values);
  fitted.camera.cov.resize(0, 0);
  const std::vector<SeenRay> rays = rays_over_image(camera);
  fit(fitted.camera, rays, free);
  double sum = 0.0;
  for (const SeenRay& seen : rays) {
    const auto px = project(fitted.camera, seen.ray);
    const double off_px = px ? (*px - seen.px).norm() : std::numeric_limits<double>::infinity();
    fitted.max_px = std::max(fitted.max_px, off_px);
    sum += off_px * off_px;
  }
  fitted.rms_px = rays.empty() ? 0.0 : std::sqrt(sum / static_cast<double>(rays.size()));
  return fitted;
}

}  // namespace alidade
