#pragma once

#include <Eigen/Core>
#include <array>
#include <vector>

#include "alidade/camera/camera.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A dark or bright area with four straight edges, seen through a lens that may curve them.
struct SeenRectangle {
  /// Clockwise as seen; the first is the one nearest to the top left.
  std::array<Eigen::Vector2d, 4> corners_px;
  double sigma_px = 0.0;      ///< Of a corner's coordinate, from what the edges leave over.
  double contrast = 0.0;      ///< Of the edges: grey values inside less those outside; dark ones are negative.
  double inside_sigma = 0.0;  ///< Of the grey values inside.
};

/// All of them that are in the image as a whole, the most contrast first. Edges are fitted as planes of rays, so that
/// corners are right where the lens curves lines.
[[nodiscard]] std::vector<SeenRectangle> find_rectangles(const cv::Mat& grey, const Camera& camera);

}  // namespace alidade
