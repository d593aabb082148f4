#include "alidade/board_detector/chessboard_corners.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <optional>
#include <utility>
#include <vector>

#include "alidade/corners/corner_fit.h"
#include "alidade/estimation/median.h"

namespace alidade {
namespace {

constexpr double min_relative_contrast = 0.15;  // of the board's median: less is not a corner of this board
constexpr std::size_t min_corners = 6;
constexpr double min_sagitta_px = 0.03;  // over one square: it moves a straight fit by 0.003 px

struct FittedCorner {
  GridCell cell;
  CornerFit fit;
};

CornerStart start_at(const GridCorner& corner, double blur_px) {
  return {.px = corner.px, .along_cols = corner.step_i, .along_rows = corner.step_j, .blur_px = blur_px};
}

/// Steps from the corners' own positions: half the way from the neighbour before to the one behind, where both are
/// known.
GridCorner with_local_steps(const CornerGrid& grid, const GridCell& cell, GridCorner corner) {
  const auto step = [&](int di, int dj, const Eigen::Vector2d& otherwise) -> Eigen::Vector2d {
    const GridCorner* before = grid.at(cell.first - di, cell.second - dj);
    const GridCorner* behind = grid.at(cell.first + di, cell.second + dj);
    if (before && behind) return 0.5 * (behind->px - before->px);
    if (before) return corner.px - before->px;
    if (behind) return behind->px - corner.px;
    return otherwise;
  };
  corner.step_i = step(1, 0, corner.step_i);
  corner.step_j = step(0, 1, corner.step_j);
  return corner;
}

/// Sign of the contrast if the board were dark in the square from (0, 0) to (1, 1).
double parity_sign(const GridCell& cell) { return (cell.first + cell.second) % 2 == 0 ? 1.0 : -1.0; }

/// Takes away fits whose colours do not alternate or whose contrast is far below the others'.
void drop_wrong_colours(std::vector<FittedCorner>& corners) {
  if (corners.empty()) return;
  std::vector<double> contrasts;
  for (const FittedCorner& corner : corners) contrasts.push_back(parity_sign(corner.cell) * corner.fit.contrast);
  const double typical = median_of(contrasts);
  std::erase_if(corners, [&](const FittedCorner& corner) {
    return !(parity_sign(corner.cell) * corner.fit.contrast * typical > min_relative_contrast * typical * typical);
  });
}

/// Curvature [1/px] of the edge through three points, positive towards the left normal (-sin, cos) of before → behind.
double bend_of(const Eigen::Vector2d& before, const Eigen::Vector2d& at, const Eigen::Vector2d& behind) {
  const Eigen::Vector2d chord = behind - before, way = 0.5 * (before + behind) - at;
  const double length = chord.norm();
  const double sagitta = (chord.x() * way.y() - chord.y() * way.x()) / length;
  return 8.0 * sagitta / (length * length);
}

class ChessboardFitter {
 public:
  ChessboardFitter(const cv::Mat& photo, const Board& board, const Chessboard& coarse)
      : photo_(photo), board_(board), grid_(coarse.grid), blur_px_(std::clamp(coarse.pixel_scale, 1.0, 4.0)) {
    config_.max_move_px = std::max(2.0, 1.5 * coarse.pixel_scale);
  }

  std::vector<FittedCorner> run() {
    std::vector<FittedCorner> corners;
    for (const auto& [cell, corner] : CornerGrid(grid_).corners) try_at(cell, corner, corners);
    look_for_missing(corners);
    drop_wrong_colours(corners);
    refit_bent(corners);
    return corners;
  }

 private:
  void try_at(const GridCell& cell, const GridCorner& corner, std::vector<FittedCorner>& corners) {
    const CornerFit fit = fit_corner(photo_, start_at(with_local_steps(grid_, cell, corner), blur_px_), config_);
    if (!fit.accepted()) return;
    blur_px_ = fit.blur_px;
    corners.push_back({cell, fit});
  }

  /// Corners at the positions that the neighbours predict, until no more are found.
  void look_for_missing(std::vector<FittedCorner>& corners) {
    grid_.corners.clear();
    for (const FittedCorner& corner : corners) grid_.corners[corner.cell].px = corner.fit.px;
    for (std::size_t before = 0; before < corners.size();) {
      before = corners.size();
      for (int row = 0; row < board_.rows; ++row) {
        for (int col = 0; col < board_.cols; ++col) {
          if (grid_.at(col, row)) continue;
          const auto predicted = predict_corner(grid_, col, row);
          if (!predicted) continue;
          try_at({col, row}, *predicted, corners);
          if (corners.size() > before && corners.back().cell == GridCell{col, row}) {
            grid_.corners[{col, row}].px = corners.back().fit.px;
          }
        }
      }
    }
  }

  /// Fits again where the neighbours' positions show that the lens curves the edges.
  void refit_bent(std::vector<FittedCorner>& corners) {
    grid_.corners.clear();
    for (const FittedCorner& corner : corners) grid_.corners[corner.cell].px = corner.fit.px;
    for (FittedCorner& corner : corners) {
      CornerStart start = start_at(
          with_local_steps(grid_, corner.cell, *grid_.at(corner.cell.first, corner.cell.second)), corner.fit.blur_px);
      start.bend_cols = bend_at(corner.cell, 1, 0);
      start.bend_rows = bend_at(corner.cell, 0, 1);
      const double sagitta_px = 0.5 * std::max(std::abs(start.bend_cols) * start.along_cols.squaredNorm(),
                                               std::abs(start.bend_rows) * start.along_rows.squaredNorm());
      if (!(sagitta_px > min_sagitta_px)) continue;
      const CornerFit again = fit_corner(photo_, start, config_);
      if (again.accepted()) corner.fit = again;
    }
  }

  /// Curvature of the grid line through a corner; of the nearest one inside where it has one neighbour only.
  [[nodiscard]] double bend_at(const GridCell& cell, int di, int dj) const {
    for (const int shift : {0, -1, 1}) {
      const int i = cell.first + shift * di, j = cell.second + shift * dj;
      const GridCorner *before = grid_.at(i - di, j - dj), *at = grid_.at(i, j), *behind = grid_.at(i + di, j + dj);
      if (before && at && behind) return bend_of(before->px, at->px, behind->px);
    }
    return 0.0;
  }

  const cv::Mat& photo_;
  Board board_;
  CornerGrid grid_;
  double blur_px_;
  CornerFitConfig config_;
};

BoardDetection to_detection(std::vector<FittedCorner> corners, const Board& board) {
  BoardDetection detection;
  std::sort(corners.begin(), corners.end(), [](const FittedCorner& a, const FittedCorner& b) {
    return std::pair(a.cell.second, a.cell.first) < std::pair(b.cell.second, b.cell.first);
  });
  if (corners.size() < min_corners) {
    detection.reason = "the corners are too blurred or too faint to be numbered: only " +
                       std::to_string(corners.size()) + " of " + std::to_string(num_points(board));
    return detection;
  }
  for (const FittedCorner& corner : corners) {
    detection.view.corners.push_back(
        {.index = corner.cell.second * board.cols + corner.cell.first, .px = corner.fit.px, .cov = corner.fit.cov});
  }
  return detection;
}

/// The start of a fit where the lens and the pose are known; none where the corner's square is not in the image.
std::optional<CornerStart> projected_start(const Camera& camera, const Rigid3& cam_from_board, const GridCell& cell,
                                           double square_m, double blur_px) {
  constexpr double reach = 0.5;  // squares: as far as the window
  std::array<Eigen::Vector2d, 5> px;
  constexpr std::array<std::array<double, 2>, 5> places{{{0, 0}, {-reach, 0}, {reach, 0}, {0, -reach}, {0, reach}}};
  for (std::size_t k = 0; k < places.size(); ++k) {
    const Eigen::Vector3d point_in_board(square_m * (cell.first + places[k][0]),
                                         square_m * (cell.second + places[k][1]), 0.0);
    const auto projected = project(camera, cam_from_board * point_in_board);
    if (!projected) return std::nullopt;
    px[k] = *projected;
  }
  return CornerStart{.px = px[0],
                     .along_cols = (px[2] - px[1]) / (2.0 * reach),
                     .along_rows = (px[4] - px[3]) / (2.0 * reach),
                     .bend_cols = bend_of(px[1], px[0], px[2]),
                     .bend_rows = bend_of(px[3], px[0], px[4]),
                     .blur_px = blur_px};
}

}  // namespace

BoardDetection fit_chessboard(const cv::Mat& photo, const Board& board, const Chessboard& coarse) {
  return to_detection(ChessboardFitter(photo, board, coarse).run(), board);
}

BoardDetection refit_chessboard(const cv::Mat& photo, const Board& board, const BoardView& first, const Camera& camera,
                                const Rigid3& cam_from_board) {
  std::vector<FittedCorner> corners;
  double blur_px = 1.0;
  for (int row = 0; row < board.rows; ++row) {
    for (int col = 0; col < board.cols; ++col) {
      const GridCell cell{col, row};
      const auto start = projected_start(camera, cam_from_board, cell, board.square_m, blur_px);
      if (!start) continue;
      const CornerFit fit = fit_corner(photo, *start);
      if (!fit.accepted()) continue;
      blur_px = fit.blur_px;
      corners.push_back({cell, fit});
    }
  }
  drop_wrong_colours(corners);
  BoardDetection detection = to_detection(std::move(corners), board);
  detection.view.photo = first.photo;
  return detection;
}

}  // namespace alidade
