#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/estimation/belief.h"
#include "alidade/track/observation_model.h"

namespace alidade {

/// The filter of Xiahou et al., "Modeling and Simulation for Target Tracking System Based on Dual-Pan-Tilt Camera",
/// 2015, in centimetres. As printed: the target is assumed to be where both axes point, process noise Q = I6 per step,
/// R = 0.01 I4 for tangents and cm alike.
struct XiahouConfig {
  double baseline_cm = 50.0;             ///< Of head 2 along x; both heads at y = z = 0, not rotated.
  double process_variance = 1.0;         ///< Q = this · I6, or this · GGᵀ.
  bool process_by_acceleration = false;  ///< The paper's equation (1), G = [Δ²/2, Δ] on each axis.
  double variance_of_tangent = 0.01, variance_of_cm = 0.01;
  bool use_pixels = false;  ///< Corrected: the angles of the pixel's ray, with the mounting of the head.
};

/// State x, vx, y, vy, z, vz [cm, cm/s]; measured k1 = x/z, k2 = (B − x)/z, k3 = k4 = −y.
class XiahouFilter {
 public:
  XiahouFilter(const XiahouConfig& config, const Eigen::Vector3d& start_cm);

  void step(const Eigen::Vector4d& measured, double dt_s);
  [[nodiscard]] const Belief<6>& state() const { return state_; }
  [[nodiscard]] Eigen::Vector3d position_cm() const { return {state_.x[0], state_.x[2], state_.x[4]}; }

 private:
  XiahouConfig config_;
  Belief<6> state_;
};

/// k1..k4 of two pairs of angles (pan, tilt). None if the lines do not meet in front (k1 + k2 < 10⁻³).
[[nodiscard]] std::optional<Eigen::Vector4d> pseudo_measurement(const Eigen::Vector2d& first_rad,
                                                                const Eigen::Vector2d& second_rad, double baseline_cm);
/// The point of k1..k4. [cm]
[[nodiscard]] Eigen::Vector3d position_of_pseudo_measurement(const Eigen::Vector4d& k, double baseline_cm);

}  // namespace alidade
