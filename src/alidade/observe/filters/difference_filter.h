#pragma once

#include "alidade/observe/filters/flow_regressor.h"
#include "alidade/observe/filters/linear_information.h"

namespace alidade {

/// Kalman filter on differences to one reference point: state [ξ; θ], ξ_{k+1} = ξ_k + hΩ_mᵀθ + w, measurement y_i = ξ_i
/// + n_i − n_reference, so that R = σ²(I + 11ᵀ) per axis. Given θ, ξ ~ (a + Bᵀθ, C) with C the same for both axes and
/// independent of θ; the noise of the reference is a state of its own, new in each frame, and the measurements are
/// processed one by one. Identical to the joint filter; O(N³) per frame for N points. No allocation after construction.
class DifferenceFilter {
 public:
  /// `variance`: σ² of one coordinate of one point.
  DifferenceFilter(std::size_t num_points, const LinearInformation<8>& theta, double variance);

  /// One frame: begin(), then move() or restart() of each point that is seen, then measure() of the same points, then
  /// finish().
  void begin(Eigen::Index reference);
  void move(Eigen::Index point, const DifferenceRegressor& h_omega, double drift_variance);
  /// For a point of which only the measurement `y` is known.
  void restart(Eigen::Index point, const Eigen::Vector2d& y);
  void measure(Eigen::Index point, const Eigen::Vector2d& y);
  void finish() { theta_.finish(); }

  [[nodiscard]] const LinearInformation<8>& theta() const { return theta_; }

 private:
  LinearInformation<8> theta_;
  double variance_;
  Eigen::Index reference_ = 0;
  Eigen::Matrix2Xd a_;
  Eigen::Matrix<double, 8, Eigen::Dynamic> b_;  // two columns per point
  Eigen::MatrixXd c_;
  Eigen::VectorXd covariance_, gain_;  // of one measurement
};

}  // namespace alidade
