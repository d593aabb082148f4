#pragma once

#include <vector>

#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

/// Extended Kalman filter on "shared parameters c + many static points" with an arrowhead covariance: given c, the
/// points are independent. Measurement updates keep that form exactly, since a pixel depends only on c and its own
/// point, and cost O(points). Process noise on c would correlate the points with each other; there the joint
/// normal distribution is projected onto the nearest arrowhead (the one that keeps c with each single point, the
/// minimum of the Kullback–Leibler divergence). Allocates nothing after construction. All pixels are normalised.
/// Bar-Shalom, Li & Kirubarajan, "Estimation with applications to tracking and navigation", 2001, section 10.3.
class ArrowheadFilter {
 public:
  ArrowheadFilter(const ObserveNuisances& nuisances, bool with_depth, std::size_t num_points);

  /// Initialises from the solution of a bundle. Other points are added when they are first seen.
  void start(const BundleSolution& solution, const std::vector<int>& bundle_point_of, double sigma_px);
  void forget_points();  ///< A new segment: points are initialised again, the shared parameters are kept.
  void forget_point(std::size_t i) { points_[i].known = false; }
  /// From now on the variance of this point's pixels is multiplied by `factor`.
  void inflate_variance(std::size_t i, double factor) { points_[i].variance_factor = factor; }

  /// Before a zoom: keeps the fx, fy, cx, cy with which the points were estimated as additional shared
  /// parameters, so that the errors that points share through them stay correlated. Later calls do nothing.
  void remember_intrinsics();
  /// Process noise: adds variances in the layout's order; with `rotation_sigma_rad` > 0 the rotation error is reset.
  void predict(const CommonVector& variance, double rotation_sigma_rad);
  /// Linearises a frame: innovations of all known points that are seen. `px` is normalised; NaN: not seen.
  void observe(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  /// The same frame after `predict`: rejected points stay rejected.
  void observe_again(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  /// Number of innovations; the index `i` below refers to this list.
  [[nodiscard]] std::size_t num_seen() const { return num_seen_; }
  [[nodiscard]] int seen_point(std::size_t i) const { return seen_[i].point; }
  void set_rejected(std::size_t i, bool out) {
    seen_[i].rejected = out;
    is_summed_ = false;
  }
  [[nodiscard]] bool is_rejected(std::size_t i) const { return seen_[i].rejected; }
  [[nodiscard]] int dof() const;
  /// Normalised innovation squared of the points not rejected.
  [[nodiscard]] double nis();
  /// NIS and update step of the shared parameters as if `variance` had been added to them before.
  struct Hypothesis {
    double nis = 0.0;
    CommonVector step;
    CommonMatrix point_change;  ///< Matrix by which the points' slopes are multiplied, minus the identity.
  };
  [[nodiscard]] Hypothesis with_added_variance(const CommonVector& variance) const;
  /// Squared innovation of a point after the step of the hypothesis, over its variance.
  [[nodiscard]] double left_over(std::size_t i, const Hypothesis& hypothesis) const;
  /// NIS of one point alone, 2 degrees of freedom.
  [[nodiscard]] double point_nis(std::size_t i) const;
  /// Adds the score of fx, fy, cx, cy, Gᵀ S⁻¹ ν, and its covariance Gᵀ S⁻¹ G; the mean is zero while nothing changes.
  void add_score(Eigen::Vector4d& score, Eigen::Matrix4d& information);
  /// Contribution of one point to it, for known shared parameters: Gᵀ R⁻¹ ν and Gᵀ R⁻¹ G.
  void add_point_score(std::size_t i, Eigen::Vector4d& score, Eigen::Matrix4d& information) const;
  /// Updates with all innovations that are not rejected, and adds new points. To be called once after `observe`.
  void update();
  /// Updates with the range of a known point. False: rejected (beyond 4 σ), or the point has no depth.
  bool update_range(const RotationFrame& frame, std::size_t point, double range_m, double sigma_range_m);

  [[nodiscard]] const RotatingCamera& camera() const { return camera_; }
  [[nodiscard]] const CommonLayout& layout() const { return layout_; }
  [[nodiscard]] const CommonMatrix& covariance() const { return covariance_; }
  [[nodiscard]] bool has_point(std::size_t point) const { return points_[point].known; }
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
    Eigen::Matrix2d inverse_cov;  ///< Inverse covariance of the innovation given c.
  };

  void accumulate();
  void add_new_points(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  void move_common(const CommonVector& step);

  ObserveNuisances nuisances_;
  CommonLayout layout_;
  bool with_depth_;
  double variance_px_ = 1e-6;
  RotatingCamera camera_;
  CommonMatrix covariance_, precision_;  ///< Covariance of the shared parameters, and its inverse.
  std::vector<Point> points_;
  std::vector<Seen> seen_;
  std::vector<bool> was_rejected_;  ///< One per point.
  std::size_t num_seen_ = 0;
  RotationFrame frame_;
  std::span<const Eigen::Vector2d> px_;
  CommonMatrix information_;  ///< Σ Gᵀ R⁻¹ G over innovations that are not rejected.
  CommonVector gradient_;     ///< Σ Gᵀ R⁻¹ ν.
  double squares_ = 0.0;      ///< Σ νᵀ R⁻¹ ν.
  bool is_summed_ = false;    ///< The three sums are up to date with the rejections.
};

}  // namespace alidade
