#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "alidade/localize/filter/feature.h"

// Without known points the scale of the world is unobservable: camera, speed and map may all be larger by one factor.
// An EKF, linearised at its changing estimate, loses that, as it does for the world's rotation (world_rotation.h), and
// a camera that accelerates then biases the scale. So the error is counted
// along the estimate: with N the state's scale direction (positions and velocities themselves, inverse depths with the
// other sign) and a reading ε = cᵀe of the scale's error, cᵀN = 1,
//     x = (1 + ε)(x̂ + e − N ε),
// which to first order is x̂ + e. What is seen is a function of the second bracket alone. While an update goes on ε is
// one more component of the state. Once the state has moved, N has moved by u, and what P holds along N it holds along
// N + u: e′ = (I + u cᵀ) e.

namespace alidade {

/// N of a feature's components; the first dim().
[[nodiscard]] Eigen::Vector<double, 6> scale_direction(const Feature& feature);

/// Derivatives of ln |y − r|, the distance between camera and feature, by r [1/m] and by the feature's components: a
/// reading of the scale. All zero where the feature is at no distance.
struct RelativeDistance {
  Eigen::Vector3d J_position = Eigen::Vector3d::Zero();
  Eigen::Vector<double, 6> J_feature = Eigen::Vector<double, 6>::Zero();
};
[[nodiscard]] RelativeDistance relative_distance(const Feature& feature, const Eigen::Vector3d& camera_in_world);

/// c: by which components of the state the scale's error is read.
class ScaleReading {
 public:
  static constexpr std::size_t max_features = 6, max_components = 3 + 6 * max_features;

  /// Adds `share` of a feature's relative distance.
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
