#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/board/board.h"

namespace alidade {

/// The print of a board: the ink at any point and the positions of its edges. Positions are nominal coordinates in
/// frame `board` [m], as those of points_in_board(). The pattern has a margin of paper around it.
class PrintedPattern {
 public:
  /// Requires a board without fault().
  explicit PrintedPattern(const Board& board);

  /// Ink at a point: 1 black, 0 paper, `outside` off the paper. Near an edge the two sides are mixed over a ramp with
  /// the given full widths [m].
  [[nodiscard]] double ink(const Eigen::Vector2d& place, const Eigen::Vector2d& ramp, double outside) const;

  /// The ink at a point if no edge is within ±`reach` [m] of it, axis by axis. None if there may be one.
  [[nodiscard]] std::optional<double> even_ink(const Eigen::Vector2d& place, const Eigen::Vector2d& reach,
                                               double outside) const;

  /// Opposite corners of the printed area (the paper without its margin).
  [[nodiscard]] Eigen::Vector2d print_min() const { return print_min_; }
  [[nodiscard]] Eigen::Vector2d print_max() const { return print_max_; }

 private:
  /// Positions where the ink may change along one axis, ascending; cell i lies between edges i−1 and i.
  struct Axis {
    std::vector<double> edges;
    std::vector<std::size_t> first_edge;  ///< Per bin: the first edge beyond the bin's start.
    double bins_per_m = 0.0;

    void finish();
    [[nodiscard]] std::size_t num_cells() const { return edges.size() + 1; }
    [[nodiscard]] std::size_t cell(double at) const;
    [[nodiscard]] double centre(std::size_t cell) const { return 0.5 * (edges[cell - 1] + edges[cell]); }
  };
  /// A cell, and the weight of its nearest neighbour.
  struct Mix {
    std::size_t near, far;
    double far_weight, distance;
  };

  [[nodiscard]] static Mix mix(const Axis& axis, double at, double ramp);
  [[nodiscard]] double cell_ink(std::size_t col, std::size_t row, double outside) const;
  [[nodiscard]] double nearest_disc_distance(const Eigen::Vector2d& place) const;
  void print_chessboard(const Board& board);
  void print_tags(const Board& board);
  void print_discs(const Board& board);
  void fill_margin(double margin_m);

  Axis x_, y_;
  std::vector<signed char> ink_;  ///< Row-major cells: 1 black, 0 paper, −1 off the paper.
  Board board_;
  double disc_radius_m_ = 0.0;  ///< 0 if no discs are printed.
  Eigen::Vector2d print_min_, print_max_;
};

}  // namespace alidade
