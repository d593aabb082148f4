#include "alidade/board_detector/grid_placement.h"

#include <algorithm>
#include <cmath>
#include <vector>

namespace alidade {
namespace {

/// A way to lay the grid on the board: a number of quarter turns, then a shift in columns and rows.
struct Placement {
  int quarter_turns = 0, shift_cols = 0, shift_rows = 0;
};

/// (i, j) after quarter turns: the board's x axis is i, j, -i, -j for 0, 1, 2, 3.
GridCell turned(const GridCell& cell, int quarter_turns) {
  const auto [i, j] = cell;
  switch (quarter_turns) {
    case 1:
      return {j, -i};
    case 2:
      return {-i, -j};
    case 3:
      return {-j, i};
    default:
      return {i, j};
  }
}

/// Extent of the rotated grid.
GridExtent turned(const GridExtent& extent, int quarter_turns) {
  const auto [i, j] = turned(GridCell{extent.i_min, extent.j_min}, quarter_turns);
  const auto [k, l] = turned(GridCell{extent.i_max, extent.j_max}, quarter_turns);
  return {std::min(i, k), std::max(i, k), std::min(j, l), std::max(j, l)};
}

/// Known borders of the rotated grid, in the same order: i_min, i_max, j_min, j_max.
GridBorders turned(const GridBorders& b, int quarter_turns) {
  switch (quarter_turns) {
    case 1:
      return {b[2], b[3], b[1], b[0]};
    case 2:
      return {b[1], b[0], b[3], b[2]};
    case 3:
      return {b[3], b[2], b[0], b[1]};
    default:
      return b;
  }
}

/// The outer square at corner (0, 0) differs from the one at the opposite corner, or, on a square board, from the
/// ones beside it: then it is the dark one.
bool colour_decides(int cols, int rows) { return (cols + rows) % 2 != 0 || (cols == rows && cols % 2 != 0); }

/// The square from (col, row) = (0, 0) to (1, 1) has the colour of the one outside (0, 0).
bool first_square_is_dark(const Placement& placement) {
  // In the grid the square between +i and +j is bright at even corners; a quarter turn looks at the next quadrant.
  return (placement.shift_cols + placement.shift_rows + placement.quarter_turns) % 2 != 0;
}

/// cos of the angle by which the board is rotated in the image: 1 where columns run right and rows down.
double uprightness(const CornerGrid& grid, int quarter_turns) {
  Eigen::Vector2d along_i = Eigen::Vector2d::Zero(), along_j = Eigen::Vector2d::Zero();
  for (const auto& [cell, corner] : grid.corners) {
    along_i += corner.step_i.normalized();
    along_j += corner.step_j.normalized();
  }
  const std::array<Eigen::Vector2d, 4> axes{along_i, along_j, -along_i, -along_j};
  const auto turn = static_cast<std::size_t>(quarter_turns);
  return axes[turn].x() + axes[(turn + 1) % 4].y();
}

std::vector<Placement> placements_of(const CornerGrid& grid, int cols, int rows, const GridBorders& borders) {
  std::vector<Placement> found;
  const GridExtent extent = extent_of(grid);
  for (int turns = 0; turns < 4; ++turns) {
    const GridExtent now = turned(extent, turns);
    const GridBorders known = turned(borders, turns);
    for (int col = 0; col + now.width() <= cols; ++col) {
      for (int row = 0; row + now.height() <= rows; ++row) {
        if ((known[0] && col != 0) || (known[1] && col + now.width() != cols)) continue;
        if ((known[2] && row != 0) || (known[3] && row + now.height() != rows)) continue;
        const Placement placement{turns, col - now.i_min, row - now.j_min};
        if (colour_decides(cols, rows) && !first_square_is_dark(placement)) continue;
        found.push_back(placement);
      }
    }
  }
  return found;
}

/// Of the placements that the board's symmetry makes equal, those that stand more upright.
std::vector<Placement> upright_ones(const CornerGrid& grid, int cols, int rows, const std::vector<Placement>& all) {
  const bool half_turn_looks_same = (cols + rows) % 2 == 0;
  const bool quarter_turn_looks_same = cols == rows && cols % 2 == 0;
  std::vector<Placement> kept;
  for (const Placement& placement : all) {
    const double here = uprightness(grid, placement.quarter_turns);
    const auto is_more_upright = [&](int more_turns) {
      const int turns = (placement.quarter_turns + more_turns) % 4;
      const double there = uprightness(grid, turns);
      return there > here || (there == here && turns < placement.quarter_turns);
    };
    if (half_turn_looks_same && is_more_upright(2)) continue;
    if (quarter_turn_looks_same && (is_more_upright(1) || is_more_upright(3))) continue;
    kept.push_back(placement);
  }
  return kept;
}

CornerGrid renumbered(const CornerGrid& grid, const Placement& placement) {
  CornerGrid board;
  for (const auto& [cell, corner] : grid.corners) {
    const auto [i, j] = turned(cell, placement.quarter_turns);
    const std::array<Eigen::Vector2d, 4> axes{corner.step_i, corner.step_j, -corner.step_i, -corner.step_j};
    const auto turn = static_cast<std::size_t>(placement.quarter_turns);
    board.corners[{i + placement.shift_cols, j + placement.shift_rows}] = {corner.px, axes[turn], axes[(turn + 1) % 4]};
  }
  return board;
}

/// "9×6", the longer side first where the asked board has it so.
std::string size_text(int width, int height, int cols, int rows) {
  if ((width < height) != (cols < rows)) std::swap(width, height);
  return std::to_string(width) + "×" + std::to_string(height);
}

/// Takes away outer lines that have less than half of their corners, while the grid is larger than the board.
CornerGrid without_stray_lines(CornerGrid grid, int cols, int rows) {
  for (;;) {
    const GridExtent extent = extent_of(grid);
    const int width = extent.width(), height = extent.height();
    const bool fits = (width <= cols && height <= rows) || (width <= rows && height <= cols);
    if (fits || width < 2 || height < 2) return grid;
    struct Line {
      bool is_column;
      int at;
      double filled;
    };
    std::vector<Line> lines{
        {true, extent.i_min, 0.0}, {true, extent.i_max, 0.0}, {false, extent.j_min, 0.0}, {false, extent.j_max, 0.0}};
    for (Line& line : lines) {
      for (const auto& [cell, corner] : grid.corners) {
        if ((line.is_column ? cell.first : cell.second) == line.at)
          line.filled += 1.0 / (line.is_column ? height : width);
      }
    }
    const Line sparsest =
        *std::min_element(lines.begin(), lines.end(), [](const Line& a, const Line& b) { return a.filled < b.filled; });
    if (!(sparsest.filled < 0.5)) return grid;
    std::erase_if(grid.corners, [&](const auto& entry) {
      return (sparsest.is_column ? entry.first.first : entry.first.second) == sparsest.at;
    });
  }
}

}  // namespace

PlacedGrid place_grid(const CornerGrid& grid, int cols, int rows, const GridBorders& borders) {
  PlacedGrid placed;
  const CornerGrid pruned = without_stray_lines(grid, cols, rows);
  const GridExtent extent = extent_of(pruned);
  const auto placements = upright_ones(pruned, cols, rows, placements_of(pruned, cols, rows, borders));
  const std::string asked = std::to_string(cols) + "×" + std::to_string(rows);
  const std::string seen = size_text(extent.width(), extent.height(), cols, rows);
  if (placements.size() == 1) {
    placed.grid = renumbered(pruned, placements.front());
  } else if (placements.empty()) {
    placed.reason = "a grid of " + seen + " corners, not " + asked;
  } else {
    placed.reason = "only " + seen + " of " + asked + " corners, and it cannot be determined which";
  }
  return placed;
}

}  // namespace alidade
