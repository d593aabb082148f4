#pragma once

#include <vector>

#include "alidade/observe/filters/flow_regressor.h"
#include "alidade/observe/filters/linear_information.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {

struct FlowFilterConfig {
  std::size_t num_points = 0;  ///< Every frame has this many pixels.
  PixelScale scale;
  Eigen::Vector4d start{1.0, 1.0, 0.0, 0.0};  ///< fx, fy, cx, cy to begin with: a weak prior, any will do. [px]
  double sigma_px = 0.3;                      ///< Of one coordinate.
  /// False: ten columns, as if the camera never rotated about its axis of view. For comparison.
  bool roll_columns = true;
  /// The regression takes the rates measured at both ends of a step, as the paper would, not their mean over it. At 30
  /// Hz that costs fx 0.2 px, the error of the trapezoid rule.
  bool rates_at_ends = false;
  double prior_sigma = 1.0;             ///< Of each Θ. [scaled]
  double drift_px_per_sqrt_s = 0.0219;  ///< w, for what the trapezoid of G misses: 10⁻⁵ scaled pixels at 30 Hz.
};

/// Fixed intrinsics of a rotating camera by a Kalman filter on the whole flow: state [ξ; Θ], ξ the points' positions in
/// scaled pixels, ξ_{k+1} = ξ_k + h G_mᵀΘ + w, measured q = ξ + n; G_m is the mean of G over both ends of the step.
/// Linear, so that it needs no guess and converges from everywhere. The estimate is Θ's projection on the four
/// intrinsics, argmin (Θ(k) − Θ̂)ᵀ P⁻¹ (Θ(k) − Θ̂).
///
/// Θ is constant and both noises are independent from coordinate to coordinate; so given Θ the coordinates are
/// independent: ξ | Θ ~ (a + Bᵀ Θ, s) each, with s the same for whatever Θ. That is the joint filter without its big
/// covariance, exactly, at a cost that grows linearly with the points. Allocates nothing after construction.
class FlowFilter {
 public:
  explicit FlowFilter(const FlowFilterConfig& config);

  /// A point that was not seen begins again where it is seen next; so do all at the start of a segment. Θ stays. A
  /// frame without a step in time changes nothing.
  IntrinsicsEstimate step(const RotationFrame& frame);

  /// Θ̂, before the projection.
  [[nodiscard]] const FlowParameters& theta() const { return theta_.mean(); }

 private:
  struct Point {
    bool is_live = false;  ///< Seen in the frame before.
    Eigen::Vector2d q = Eigen::Vector2d::Zero();
    Eigen::Vector2d a = Eigen::Vector2d::Zero();
    FlowRegressor b = FlowRegressor::Zero();
    double s = 0.0;
  };

  void advance(Point& point, const Eigen::Vector2d& q, const RotationFrame& frame);
  void restart(Point& point, const Eigen::Vector2d& q) const;
  /// A point of the four-dimensional surface of possible Θ, and how far Θ̂ is from it.
  struct Projection {
    Eigen::Vector4d k, sigma = Eigen::Vector4d::Zero();
    double chi2 = 0.0;
  };
  void project();
  [[nodiscard]] Projection projection_from(const Eigen::Vector4d& start,
                                           const Eigen::Matrix<double, 14, 14>& information) const;
  [[nodiscard]] IntrinsicsEstimate estimate(ObserveEvent event) const;

  FlowFilterConfig config_;
  Eigen::Index num_columns_;
  double variance_;
  LinearInformation<14> theta_;
  std::vector<Point> points_;
  Eigen::Vector3d last_rate_ = Eigen::Vector3d::Zero();
  bool has_begun_ = false;
  Eigen::Vector4d k_;  // projection, scaled
  Eigen::Vector4d sigma_k_ = Eigen::Vector4d::Zero();
  bool has_value_ = false;
};

}  // namespace alidade
