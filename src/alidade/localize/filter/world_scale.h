#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "alidade/localize/filter/feature.h"

// Without known points the scale of the world is unobservable: camera, velocity and map may all be larger by one
// factor. An EKF, linearised at its changing estimate, violates that, as it does for the world's rotation
// (world_rotation.h), and a camera that accelerates then biases the scale. So the error is defined along the estimate:
// with N the state's scale direction (positions and velocities themselves, inverse depths with the opposite sign) and a
// linear reading ε = cᵀe of the scale error, cᵀN = 1,
//     x = (1 + ε)(x̂ + e − N ε),
// which to first order is x̂ + e. Observations are functions of the second bracket only. During an update, ε is an
// additional component of the state. When the state has moved, N has changed by u, and the covariance along N is
// transferred to N + u: e′ = (I + u cᵀ) e.

namespace alidade {

/// N for the components of a feature; the first dim() are valid.
[[nodiscard]] Eigen::Vector<double, 6> scale_direction(const Feature& feature);

/// Derivatives of ln |y − r|, the distance between camera and feature, with respect to r [1/m] and the feature's
/// components: a reading of the scale. All zero if the distance is zero.
struct RelativeDistance {
  Eigen::Vector3d J_position = Eigen::Vector3d::Zero();
  Eigen::Vector<double, 6> J_feature = Eigen::Vector<double, 6>::Zero();
};
[[nodiscard]] RelativeDistance relative_distance(const Feature& feature, const Eigen::Vector3d& camera_in_world);

/// c: the weights of the state components in the reading of the scale error.
class ScaleReading {
 public:
  static constexpr std::size_t max_features = 6, max_components = 3 + 6 * max_features;

  /// Adds `share` times the relative distance of a feature.
  void add(const Feature& feature, const RelativeDistance& distance, double share);
  [[nodiscard]] std::span<const int> columns() const { return {columns_.data(), num_}; }
  [[nodiscard]] std::span<const double> weights() const { return {weights_.data(), num_}; }
  [[nodiscard]] bool is_empty() const { return num_ == 0; }

 private:
  std::array<int, max_components> columns_{0, 1, 2};  ///< The camera's position first.
  std::array<double, max_components> weights_{};
  std::size_t num_ = 0;
};

}  // namespace alidade
