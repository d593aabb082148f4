#pragma once

#include <vector>

#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

/// Extended Kalman filter on "shared parameters c + many static points", with an arrowhead covariance:
/// given c, the points are independent. Measurement updates keep that form exactly, for a pixel depends on c and its
/// own point alone, and cost O(points). Process noise on c would tie the points to each other; there the joint normal
/// is projected on the nearest arrowhead (the one that keeps c with each single point, the minimum of the
/// Kullback–Leibler divergence). Allocates nothing after construction. Everything is in normalised pixels. Bar-Shalom,
/// Li & Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 10.3.
class ArrowheadFilter {
 public:
  ArrowheadFilter(const ObserveNuisances& nuisances, bool with_depth, std::size_t num_points);

  /// Begins with a bundle's solution. Points that it does not know join when they are seen.
  void start(const BundleSolution& solution, const std::vector<int>& bundle_point_of, double sigma_px);
  void forget_points();  ///< A new segment: points are met again, what they have in common stays.
  void forget_point(std::size_t i) { points_[i].known = false; }
  /// From now on this point's pixels have so many times their variance.
  void distrust(std::size_t i, double factor) { points_[i].variance_factor = factor; }

  /// The intrinsics are about to change, the points are not: keeps fx, fy, cx, cy as the points were estimated with as
  /// further shared parameters, so that what the points have in common stays in common. Once; later calls do nothing.
  void remember_intrinsics();
  /// The shared parameters walk: variances added, in the layout's order; `turn` is drawn again where `turn_sigma` > 0.
  void predict(const CommonVector& variance, double turn_sigma_rad);
  /// Takes up a frame: innovations of all known points that were seen. `px` normalised, NaN: not seen.
  void observe(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  /// Innovations are of so many points; point `i` (an index in this list) can be rejected.
  [[nodiscard]] std::size_t num_seen() const { return num_seen_; }
  [[nodiscard]] int seen_point(std::size_t i) const { return seen_[i].point; }
  void leave_out(std::size_t i, bool out) {
    seen_[i].rejected = out;
    is_summed_ = false;
  }
  [[nodiscard]] bool is_rejected(std::size_t i) const { return seen_[i].rejected; }
  [[nodiscard]] int dof() const;
  /// Normalised innovation squared of the points not rejected.
  [[nodiscard]] double nis();
  /// The same with `variance` added to the shared parameters before, and how they would move.
  struct Walk {
    double nis = 0.0;
    CommonVector step;
  };
  [[nodiscard]] Walk if_walked(const CommonVector& variance) const;
  /// The same of one point alone, 2 degrees of freedom.
  [[nodiscard]] double own_nis(std::size_t i) const;
  /// Adds the score of fx, fy, cx, cy, Gᵀ S⁻¹ ν, and its covariance Gᵀ S⁻¹ G: zero on the mean while nothing changes.
  void add_score(Eigen::Vector4d& score, Eigen::Matrix4d& information);
  /// One point's share of it, as if the shared parameters were known: Gᵀ R⁻¹ ν and Gᵀ R⁻¹ G.
  void add_own_score(std::size_t i, Eigen::Vector4d& score, Eigen::Matrix4d& information) const;
  /// Takes the innovations in, but those rejected; new points join. After `observe`, once.
  void update();
  /// Takes a range of a known point in. False: it does not fit (beyond 4 σ), or the point has no depth.
  bool update_range(const RotationFrame& frame, std::size_t point, double range_m, double sigma_range_m);

  [[nodiscard]] const RotatingCamera& camera() const { return camera_; }
  [[nodiscard]] const CommonLayout& layout() const { return layout_; }
  [[nodiscard]] const CommonMatrix& covariance() const { return covariance_; }
  [[nodiscard]] bool knows(std::size_t point) const { return points_[point].known; }
  [[nodiscard]] const BearingPoint& point(std::size_t i) const { return points_[i].bearing; }
  [[nodiscard]] PointGivenCommon given_common(std::size_t i) const { return {points_[i].slope, points_[i].cov}; }

 private:
  struct Point {
    BearingPoint bearing;
    PointByCommonSlope slope;
    Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
    double variance_factor = 1.0;
    bool known = false;
  };
  struct Seen {
    int point = 0;
    bool rejected = false;
    Eigen::Vector2d innovation;
    Eigen::Matrix<double, 2, 3> J_point;
    PixelByCommon through_point;  ///< ∂px/∂c through the point's slope alone.
    PixelByCommon by_common;      ///< ∂px/∂c through c and through the point's slope.
    Eigen::Matrix2d inverse_cov;  ///< Of the innovation given c.
  };

  void accumulate();
  void add_new_points(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  void move_common(const CommonVector& step);

  ObserveNuisances nuisances_;
  CommonLayout layout_;
  bool with_depth_;
  double variance_px_ = 1e-6;
  RotatingCamera camera_;
  CommonMatrix covariance_, precision_;  ///< Of the shared parameters, and its inverse.
  std::vector<Point> points_;
  std::vector<Seen> seen_;
  std::size_t num_seen_ = 0;
  RotationFrame frame_;
  std::span<const Eigen::Vector2d> px_;
  CommonMatrix information_;  ///< Σ Gᵀ R⁻¹ G of those not rejected.
  CommonVector gradient_;     ///< Σ Gᵀ R⁻¹ ν.
  double squares_ = 0.0;      ///< Σ νᵀ R⁻¹ ν.
  bool is_summed_ = false;    ///< The three sums are of what is not rejected now.
};

}  // namespace alidade
