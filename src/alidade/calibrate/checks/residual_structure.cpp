#include <algorithm>
#include <cmath>

#include "alidade/calibrate/checks/residual_structure.h"

namespace alidade {
namespace {

/// Visits every used corner as (seen pixel, residual).
template <class Visit>
void for_each_residual(std::span<const BoardView> views, const CalibrateReport& report, Visit&& visit) {
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (!report.views[k].used) continue;
    for (std::size_t i = 0; i < views[k].corners.size(); ++i) {
      const CornerResidual& fit = report.views[k].corners[i];
      if (fit.used) visit(views[k].corners[i].px, fit.residual_px);
    }
  }
}

}  // namespace

std::vector<ResidualCell> residual_cells(std::span<const BoardView> views, const CalibrateReport& report, int cols,
                                         int rows) {
  std::vector<ResidualCell> cells(static_cast<std::size_t>(cols * rows));
  const double width = report.camera.width_px, height = report.camera.height_px;
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      ResidualCell& cell = cells[static_cast<std::size_t>(row * cols + col)];
      cell.u_px = (col + 0.5) * width / cols - 0.5;
      cell.v_px = (row + 0.5) * height / rows - 0.5;
    }
  }
  for_each_residual(views, report, [&](const Eigen::Vector2d& px, const Eigen::Vector2d& residual) {
    const int col = std::clamp(static_cast<int>((px.x() + 0.5) / width * cols), 0, cols - 1);
    const int row = std::clamp(static_cast<int>((px.y() + 0.5) / height * rows), 0, rows - 1);
    ResidualCell& cell = cells[static_cast<std::size_t>(row * cols + col)];
    cell.mean_px += residual;
    ++cell.count;
  });
  for (ResidualCell& cell : cells) {
    if (cell.count == 0) continue;
    cell.mean_px /= cell.count;
    cell.z = cell.mean_px.norm() * std::sqrt(cell.count) / std::max(shared_noise_px(report), 1e-12);
  }
  return cells;
}

std::vector<ResidualRing> residual_rings(std::span<const BoardView> views, const CalibrateReport& report,
                                         int num_rings) {
  const Eigen::Vector2d centre = params(report.camera.lens).segment<2>(2);
  double farthest = 1.0;
  for_each_residual(views, report, [&](const Eigen::Vector2d& px, const Eigen::Vector2d&) {
    farthest = std::max(farthest, (px - centre).norm());
  });
  std::vector<ResidualRing> rings(static_cast<std::size_t>(num_rings));
  for (int i = 0; i < num_rings; ++i) rings[static_cast<std::size_t>(i)].radius_px = (i + 0.5) * farthest / num_rings;
  for_each_residual(views, report, [&](const Eigen::Vector2d& px, const Eigen::Vector2d& residual) {
    const Eigen::Vector2d arm = px - centre;
    const double radius = std::max(arm.norm(), 1e-9);
    const int at = std::clamp(static_cast<int>(radius / farthest * num_rings), 0, num_rings - 1);
    ResidualRing& ring = rings[static_cast<std::size_t>(at)];
    ring.mean_radial_px += residual.dot(arm) / radius;
    ring.mean_tangential_px += (arm.x() * residual.y() - arm.y() * residual.x()) / radius;
    ++ring.count;
  });
  for (ResidualRing& ring : rings) {
    if (ring.count == 0) continue;
    ring.mean_radial_px /= ring.count;
    ring.mean_tangential_px /= ring.count;
    ring.sigma_px = shared_noise_px(report) / std::sqrt(ring.count);
  }
  return rings;
}

}  // namespace alidade
