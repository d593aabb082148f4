#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// A pixel around which the image varies in two directions, so that it can be located again.
struct CornerFeature {
  Eigen::Vector2i px = Eigen::Vector2i::Zero();
  double strength = 0.0;
};

struct CornerFeatureConfig {
  int cell_px = 32;               ///< Side of the grid cells; one feature each.
  int margin_px = 14;             ///< From the border of the image.
  double min_strength = 4.0;      ///< Weaker ones are noise, or lie on an edge. [grey values per px]
  double min_distance_px = 16.0;  ///< To the occupied ones.
};

/// The strongest corner of each cell of a grid over the image that contains none of `occupied`; strongest first.
/// Strength is the root of the smaller eigenvalue of the mean of ∇g ∇gᵀ over 7×7 pixels: J. Shi & C. Tomasi, "Good
/// features to track", CVPR 1994. The image has one channel of 8 bits.
[[nodiscard]] std::vector<CornerFeature> corners_in_empty_cells(const cv::Mat& grey,
                                                                std::span<const Eigen::Vector2d> occupied,
                                                                const CornerFeatureConfig& config = {});

}  // namespace alidade
