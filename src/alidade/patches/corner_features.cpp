#include "alidade/patches/corner_features.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <optional>

namespace alidade {
namespace {

constexpr int block_px = 7;

bool is_taken(const Eigen::Vector2d& px, std::span<const Eigen::Vector2d> near, double min_distance_px) {
  return std::ranges::any_of(
      near, [&](const Eigen::Vector2d& at) { return (at - px).squaredNorm() < min_distance_px * min_distance_px; });
}

/// The best pixel of a cell that is not close to one of `near`.
std::optional<CornerFeature> best_in(const cv::Mat& grey, const cv::Rect& cell, std::span<const Eigen::Vector2d> near,
                                     const CornerFeatureConfig& config) {
  cv::Mat eigenvalue;
  cv::cornerMinEigenVal(grey(cell), eigenvalue, block_px, 3);  // reads beyond the cell; scaled to 8 bits and area
  CornerFeature best;
  float largest = 0.0f;
  for (int row = 0; row < cell.height; ++row) {
    const float* const value = eigenvalue.ptr<float>(row);
    for (int col = 0; col < cell.width; ++col) {
      if (value[col] <= largest) continue;
      if (is_taken({cell.x + col, cell.y + row}, near, config.min_distance_px)) continue;
      largest = value[col];
      best.px = {cell.x + col, cell.y + row};
    }
  }
  // OpenCV's 3×3 derivative is 8 times the gradient, divided by 4 · 7 · 255; then it sums over 7×7.
  best.strength = std::sqrt(largest) * 255.0 / 2.0;
  if (!(best.strength >= config.min_strength)) return std::nullopt;
  return best;
}

}  // namespace

std::vector<CornerFeature> corners_in_empty_cells(const cv::Mat& grey, std::span<const Eigen::Vector2d> occupied,
                                                  const CornerFeatureConfig& config) {
  std::vector<CornerFeature> found;
  const cv::Rect inside(config.margin_px, config.margin_px, grey.cols - 2 * config.margin_px,
                        grey.rows - 2 * config.margin_px);
  if (inside.width <= 0 || inside.height <= 0) return found;
  std::vector<Eigen::Vector2d> near;
  for (int y = inside.y; y < inside.y + inside.height; y += config.cell_px) {
    for (int x = inside.x; x < inside.x + inside.width; x += config.cell_px) {
      const cv::Rect cell = cv::Rect(x, y, config.cell_px, config.cell_px) & inside;
      const Eigen::Vector2d centre(x + 0.5 * cell.width, y + 0.5 * cell.height);
      near.clear();
      bool is_empty = true;
      for (const Eigen::Vector2d& at : occupied) {
        const double away_px = (at - centre).cwiseAbs().maxCoeff();
        is_empty = is_empty && away_px > 0.5 * config.cell_px;
        if (away_px < config.cell_px + config.min_distance_px) near.push_back(at);
      }
      if (!is_empty) continue;
      for (const CornerFeature& other : found) near.push_back(other.px.cast<double>());
      if (const auto best = best_in(grey, cell, near, config)) found.push_back(*best);
    }
  }
  std::ranges::sort(found, std::greater{}, &CornerFeature::strength);
  return found;
}

}  // namespace alidade
