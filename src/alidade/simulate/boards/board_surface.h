#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <vector>

#include "alidade/board/board.h"

namespace alidade {

/// The surface of a curved board: nominal position (s, t) → point in frame `board` [m]. It contains every true point of
/// the board; between and around them the displacement from the plane is a smooth cubic (Hermite) in both coordinates,
/// and a parabola if the points lie on one.
class BoardSurface {
 public:
  /// `true_points` in the board's order.
  BoardSurface(const Board& board, std::span<const Eigen::Vector3d> true_points);

  [[nodiscard]] bool is_flat() const { return is_flat_; }
  [[nodiscard]] Eigen::Vector3d point(const Eigen::Vector2d& place) const { return patch(place).point; }

  /// Intersection of a ray with the surface in front of its origin, from the initial guess `start`. None if it misses.
  [[nodiscard]] std::optional<Eigen::Vector2d> intersect(const Eigen::Vector3d& origin_in_board,
                                                         const Eigen::Vector3d& ray_in_board,
                                                         const Eigen::Vector2d& start) const;

 private:
  struct Patch {
    Eigen::Vector3d point, along_s, along_t;  ///< Point and its derivatives.
  };
  [[nodiscard]] Patch patch(const Eigen::Vector2d& place) const;
  /// A staggered grid lacks every other node: it takes the parabola through the three nearest in its row.
  void fill_gaps(const std::vector<bool>& known);
  [[nodiscard]] const Eigen::Vector3d& node(std::size_t col, std::size_t row) const {
    return nodes_[row * s_.size() + col];
  }

  std::vector<double> s_, t_;           ///< Ascending coordinates of the nodes.
  std::vector<Eigen::Vector3d> nodes_;  ///< Displacement [m], row-major.
  bool is_flat_ = true;
};

}  // namespace alidade
