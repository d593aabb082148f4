#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// A pixel around which the image changes in two directions, so that it can be found again.
struct CornerFeature {
  Eigen::Vector2i px = Eigen::Vector2i::Zero();
  double strength = 0.0;
};

struct CornerFeatureConfig {
  int cell_px = 32;               ///< Side of the grid's cells: one feature each.
  int margin_px = 14;             ///< From the image's edge.
  double min_strength = 4.0;      ///< Weaker ones are noise, or lie on an edge. [grey values a pixel]
  double min_distance_px = 16.0;  ///< To those that are there already.
};

/// The strongest corner of each cell of a grid over the image that holds none of `occupied`; strongest first.
/// Strength is the root of the smaller eigenvalue of the mean of ∇g ∇gᵀ over 7×7 pixels: J. Shi & C. Tomasi, "Good
/// features to track", CVPR 1994. The image has one channel of 8 bits.
[[nodiscard]] std::vector<CornerFeature> corners_in_empty_cells(const cv::Mat& grey,
                                                                std::span<const Eigen::Vector2d> occupied,
                                                                const CornerFeatureConfig& config = {});

}  // namespace alidade
