#pragma once

#include <Eigen/Core>
#include <map>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "alidade/corners/saddle_points.h"

namespace cv {
class Mat;
}

namespace alidade {

/// Position in a grid: (i, j) counts along its first and second direction, from an arbitrary origin.
using GridCell = std::pair<int, int>;

/// A corner of a grid and the steps to its neighbours at (i + 1, j) and (i, j + 1), as far as known.
struct GridCorner {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d step_i = Eigen::Vector2d::Zero(), step_j = Eigen::Vector2d::Zero();
  float middle = 0.0f, contrast = 0.0f;  ///< Of its saddle point.
};

/// Saddle points arranged like the inner corners of a chessboard. Right-handed in the image: j is 90° clockwise of i.
/// The square from corner (i, j) to (i + 1, j + 1) is bright if i + j is even.
struct CornerGrid {
  std::map<GridCell, GridCorner> corners;
  [[nodiscard]] const GridCorner* at(int i, int j) const {
    const auto found = corners.find({i, j});
    return found == corners.end() ? nullptr : &found->second;
  }
};

/// First and last i and j of a grid.
struct GridExtent {
  int i_min = 0, i_max = -1, j_min = 0, j_max = -1;
  [[nodiscard]] int width() const { return i_max - i_min + 1; }
  [[nodiscard]] int height() const { return j_max - j_min + 1; }
};
[[nodiscard]] GridExtent extent_of(const CornerGrid& grid);

/// Predicted position of corner (i, j) from its neighbours in the grid; none without three of them in a row or square.
[[nodiscard]] std::optional<GridCorner> predict_corner(const CornerGrid& grid, int i, int j);

/// Grows grids from every four saddle points that form a square of a chessboard with eight neighbours of the right
/// colours, each by local prediction, so that strong tilt and distortion do no harm. Largest first; grids with fewer
/// than six corners are rejected. `image` is the one in which the points were detected.
[[nodiscard]] std::vector<CornerGrid> grow_grids(const cv::Mat& image, std::span<const SaddlePoint> points);

}  // namespace alidade
