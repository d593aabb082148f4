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
  double sigma_px = 0.0;      ///< σ of a corner's coordinate, from the residuals of the edges.
  double contrast = 0.0;      ///< Contrast of the edges: grey values inside minus outside; negative if dark.
  double inside_sigma = 0.0;  ///< σ of the grey values inside.
};

/// All rectangles that are wholly in the image, in order of decreasing contrast. Edges are fitted as planes of rays, so
/// that corners are correct even if the lens curves lines.
[[nodiscard]] std::vector<SeenRectangle> find_rectangles(const cv::Mat& grey, const Camera& camera);

}  // namespace alidade
