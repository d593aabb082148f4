#pragma once

#include "alidade/observe/filters/flow_regressor.h"
#include "alidade/observe/filters/linear_information.h"

namespace alidade {

/// Kalman filter on differences to one reference point: state [ξ; θ], ξ_{k+1} = ξ_k + hΩ_mᵀθ + w, measured
/// y_i = ξ_i + n_i − n_reference, so that R = σ²(I + 11ᵀ) an axis. Given θ, ξ ~ (a + Bᵀθ, C) with C the same on both
/// axes and for whatever θ; the reference's noise is a state of its own that is new in each frame, and the measurements
/// are taken one by one. Exactly the joint filter; a frame costs N³ for N points. Allocates nothing after construction.
class DifferenceFilter {
 public:
  /// `variance`: σ² of one coordinate of one point.
  DifferenceFilter(std::size_t num_points, const LinearInformation<8>& theta, double variance);

  /// A frame is begin(), then move() or restart() of each point that is seen, then measure() of the same, then
  /// finish().
  void begin(Eigen::Index reference);
  void move(Eigen::Index point, const DifferenceRegressor& h_omega, double drift_variance);
  /// Nothing is known of where the point is but `y`.
  void restart(Eigen::Index point, const Eigen::Vector2d& y);
  void measure(Eigen::Index point, const Eigen::Vector2d& y);
  void finish() { theta_.finish(); }

  [[nodiscard]] const LinearInformation<8>& theta() const { return theta_; }

 private:
  LinearInformation<8> theta_;
  double variance_;
  Eigen::Index reference_ = 0;
  Eigen::Matrix2Xd a_;
  Eigen::Matrix<double, 8, Eigen::Dynamic> b_;  // two columns a point
  Eigen::MatrixXd c_;
  Eigen::VectorXd covariance_, gain_;  // of one measurement
};

}  // namespace alidade
