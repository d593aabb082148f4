#pragma once

#include <vector>

#include "alidade/observe/filters/flow_regressor.h"
#include "alidade/observe/filters/linear_information.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {

struct FlowFilterConfig {
  std::size_t num_points = 0;  ///< Number of pixels in each frame.
  PixelScale scale;
  Eigen::Vector4d start{1.0, 1.0, 0.0, 0.0};  ///< Initial fx, fy, cx, cy [px]: a weak prior, any values will do.
  double sigma_px = 0.3;                      ///< σ of one coordinate.
  /// False: ten columns, as if the camera never rotated about its optical axis. For comparison.
  bool roll_columns = true;
  /// Uses the rates measured at both ends of a step, as the paper would, instead of the mean
  /// rate over the step. At 30 Hz this costs 0.2 px in fx, the error of the trapezoid rule.
  bool rates_at_ends = false;
  double prior_sigma = 1.0;             ///< σ of each component of Θ [scaled].
  double drift_px_per_sqrt_s = 0.0219;  ///< w, for trapezoid errors of G: 10⁻⁵ scaled pixels at 30 Hz.
};

/// Constant intrinsics of a rotating camera by a Kalman filter on the whole flow: state [ξ; Θ], where ξ are
/// the positions of the points in scaled pixels, ξ_{k+1} = ξ_k + h G_mᵀΘ + w, measurement q = ξ + n; G_m is
/// the mean of G over both ends of the step. It is linear, so it needs no initial guess and converges
/// globally. The estimate is the projection of Θ̂ on the four intrinsics, argmin (Θ(k) − Θ̂)ᵀ P⁻¹ (Θ(k) − Θ̂).
///
/// Θ is constant and both noises are independent between coordinates, so given Θ the coordinates are independent:
/// ξ | Θ ~ (a + Bᵀ Θ, s) each, with s independent of Θ. This equals the joint filter exactly, without its large
/// covariance, at a cost that grows linearly with the points. Allocates nothing after construction.
class FlowFilter {
 public:
  explicit FlowFilter(const FlowFilterConfig& config);

  /// A point that was not seen is reinitialised where it is seen next; likewise all points
  /// at the start of a segment. Θ is kept. A frame with a time step of zero changes nothing.
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
  /// A point on the four-dimensional manifold of possible Θ, and the distance of Θ̂ from it.
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
  Eigen::Vector4d k_;  // the projection, scaled
  Eigen::Vector4d sigma_k_ = Eigen::Vector4d::Zero();
  bool has_value_ = false;
};

}  // namespace alidade
