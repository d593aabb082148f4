#include "alidade/spot/printed_squares.h"

#include <algorithm>
#include <cmath>
#include <limits>

namespace alidade {
namespace {

/// Printed area in frame board [m]: the squares around the inner corners, or half a pitch around other points.
Eigen::AlignedBox2d printed_area(const Board& board) {
  Eigen::AlignedBox2d area;
  for (const Eigen::Vector3d& point : points_in_board(board)) area.extend(point.head<2>());
  const bool has_squares = board.kind == BoardKind::chessboard || board.kind == BoardKind::charuco;
  const double margin = has_squares ? board.square_m : 0.5 * board.square_m;
  area.extend(area.min() - Eigen::Vector2d::Constant(margin));
  area.extend(area.max() + Eigen::Vector2d::Constant(margin));
  return area;
}

/// Points on the board, in squares, seen by the pixels of a part: exact on every eighth pixel, linear between, which
/// errs by less than 0.01 px where a lens distorts by less than one pixel in 30.
class SquaresSeen {
 public:
  SquaresSeen(const SeenBoard& seen, int u_min, int v_min, int cols, int rows)
      : cols_(cols / step + 2), nodes_(static_cast<std::size_t>(cols_ * (rows / step + 2))) {
    const Rigid3 board_from_cam = seen.cam_from_board.inverse();
    std::vector<Eigen::Vector2d> pixels;
    for (int row = 0; row < rows / step + 2; ++row)
      for (int col = 0; col < cols_; ++col) pixels.emplace_back(u_min + col * step, v_min + row * step);
    const auto rays = observation_rays(seen.camera, pixels);
    for (std::size_t i = 0; i < nodes_.size(); ++i) {
      nodes_[i].setConstant(std::numeric_limits<float>::quiet_NaN());
      if (!rays[i]) continue;
      const Eigen::Vector3d ray = board_from_cam.rotation * rays[i]->direction_in_cam;
      const Eigen::Vector3d origin = board_from_cam * rays[i]->origin_in_cam;
      const double depth = -origin.z() / ray.z();
      if (!(depth > 0.0)) continue;
      const Eigen::Vector2d place = origin.head<2>() + depth * ray.head<2>();
      nodes_[i] = (place / seen.board.square_m).cast<float>();
    }
  }

  /// Of pixel (col, row) of the part; and the steps to the next pixel.
  struct Place {
    Eigen::Array2f at, across, down;
  };
  [[nodiscard]] Place operator()(int col, int row) const {
    const std::size_t i = static_cast<std::size_t>((row / step) * cols_ + col / step);
    const float x = static_cast<float>(col % step) / step, y = static_cast<float>(row % step) / step;
    const Eigen::Array2f &a = nodes_[i], &b = nodes_[i + 1], &c = nodes_[i + static_cast<std::size_t>(cols_)],
                         &d = nodes_[i + static_cast<std::size_t>(cols_) + 1];
    const Eigen::Array2f above = a + x * (b - a), below = c + x * (d - c);
    return {above + y * (below - above), (b - a) / step, (below - above) / step};
  }

 private:
  static constexpr int step = 8;
  int cols_;
  std::vector<Eigen::Array2f> nodes_;
};

/// The wave ±1 of squares along one axis, a ramp of one pixel at its edges.
float square_wave(float at, float px_squares) {
  const float nearest = std::round(at);
  const float ramp = std::clamp((at - nearest) / std::max(px_squares, 1e-6F) * 2.0F, -1.0F, 1.0F);
  return std::fmod(std::abs(nearest), 2.0F) < 0.5F ? ramp : -ramp;
}

}  // namespace

std::vector<Eigen::Vector2d> printed_outline(const SeenBoard& seen) {
  const Eigen::AlignedBox2d area = printed_area(seen.board);
  const Eigen::Vector2d low = area.min(), high = area.max();
  const Eigen::Vector2d corners[] = {low, {high.x(), low.y()}, high, {low.x(), high.y()}, low};
  std::vector<Eigen::Vector2d> outline;
  constexpr int steps = 6;
  for (int side = 0; side < 4; ++side) {
    for (int i = 0; i < steps; ++i) {
      const Eigen::Vector2d place = corners[side] + (corners[side + 1] - corners[side]) * i / steps;
      const auto px = project(seen.camera, seen.cam_from_board * Eigen::Vector3d(place.x(), place.y(), 0.0));
      if (!px) return {};
      outline.push_back(*px);
    }
  }
  return outline;
}

Image paper_share(const SeenBoard& seen, int u_min, int v_min, int cols, int rows) {
  const SquaresSeen squares(seen, u_min, v_min, cols, rows);
  Image paper(rows, cols);
  const auto last_x = static_cast<float>(seen.board.cols), last_y = static_cast<float>(seen.board.rows);
  for (int row = 0; row < rows; ++row) {
    for (int col = 0; col < cols; ++col) {
      const auto place = squares(col, row);
      const Eigen::Array2f px = (place.across.square() + place.down.square()).sqrt();  // squares a pixel
      if (!(place.at.abs() < 1e4F).all()) {
        paper(row, col) = 1.0F;
        continue;
      }
      // The square at the top left is black: it lies at (-1 … 0)², where both waves are negative.
      const float x = std::clamp(place.at.x(), -0.5F, last_x - 0.5F),
                  y = std::clamp(place.at.y(), -0.5F, last_y - 0.5F);
      const float chess = 0.5F - 0.5F * square_wave(x, px.x()) * square_wave(y, px.y());
      const auto inside = [](float at, float last, float width) {
        return std::clamp(0.5F + std::min(at + 1.0F, last - at) / std::max(width, 1e-6F), 0.0F, 1.0F);
      };
      const float printed = inside(place.at.x(), last_x, px.x()) * inside(place.at.y(), last_y, px.y());
      paper(row, col) = 1.0F - printed * (1.0F - chess);
    }
  }
  return paper;
}

}  // namespace alidade
