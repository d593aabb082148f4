#pragma once

#include <Eigen/Geometry>
#include <span>
#include <vector>

namespace alidade {

/// fx, fy, cx, cy of a camera that rotates as measured, from pixels of static points, all rows adjusted
/// together: what observe() with method `batch` gives where nothing is wrong with a log, without its search for what
/// may be. Gauss–Newton; given the intrinsics points are independent and eliminated one by one. Four points go side by
/// side, so that 200 rows of them take some tens of microseconds; nothing is allocated after the first call.
/// Triggs et al., "Bundle adjustment — a modern synthesis", 2000, §6.
class TurningAdjustment {
 public:
  /// cam_from_start of each row.
  TurningAdjustment(const std::vector<Eigen::Quaterniond>& cam_from_start, std::size_t num_points);

  [[nodiscard]] std::size_t num_rows() const { return rotations_.size() / 9; }
  [[nodiscard]] std::size_t num_points() const { return num_points_; }

  struct Solution {
    bool has_value = false;
    Eigen::Vector4d k = Eigen::Vector4d::Zero();    ///< fx, fy, cx, cy. [px]
    Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();  ///< By the noise that the residuals show.
    double sigma_px = 0.0;                          ///< Of a coordinate, by the residuals.
  };
  /// `px`: row by row, a pixel per point. `start`: where the intrinsics are looked for first.
  [[nodiscard]] Solution solve(std::span<const Eigen::Vector2d> px, const Eigen::Vector4d& start);
  /// The Cramér–Rao bound at the truth: pixels without noise, and their σ.
  [[nodiscard]] Eigen::Matrix4d bound(std::span<const Eigen::Vector2d> px, const Eigen::Vector4d& k, double sigma_px);

 private:
  using Lanes = Eigen::Array4d;
  /// Four points: where they are, (a, b, 1) at the start, and the sums of one pass over the rows.
  struct Group {
    Lanes a, b;
    Lanes xx, x, yy, y;                    // of the intrinsics' information
    Lanes ax, a1, bx, b1, ay, a2, by, b2;  // between them and the points
    Lanes aa, ab, bb;                      // of the points
    Lanes gfx, gcx, gfy, gcy, ga, gb;      // gradients
    Lanes squares;
  };

  void take(std::span<const Eigen::Vector2d> px);
  void place_points(const Eigen::Vector4d& k);
  void pass(std::size_t stride, const Eigen::Vector4d& k);
  void sum_row(std::size_t row, const Eigen::Vector4d& k, Group& group, std::size_t g) const;
  [[nodiscard]] bool step(std::size_t num_rows, Eigen::Vector4d& k);

  std::size_t num_points_;
  std::vector<double> rotations_;  ///< Nine numbers a row, row-major.
  std::vector<Group> groups_;
  std::vector<Lanes> u_, v_;  ///< Group by group, row by row.
  // Of the last step:
  Eigen::Matrix4d information_ = Eigen::Matrix4d::Zero();  ///< Points eliminated, of σ = 1 px.
  double squares_ = 0.0, gain_ = 0.0;                      ///< Of the residuals before it; what it takes from them.
};

}  // namespace alidade
