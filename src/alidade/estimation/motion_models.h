#pragma once

#include <Eigen/Core>
#include <concepts>

#include "alidade/estimation/belief.h"

namespace alidade {

/// Motion of a target between measurements: returns the belief a time dt ≥ 0 later. The first three components of every
/// state are the position [m], the next three the velocity [m/s]; the frame is the caller's and does not rotate.
template <class Model>
concept MotionModel = requires(const Model& model, const Belief<Model::dim>& belief, double dt_s) {
  { Model::dim } -> std::convertible_to<int>;
  { model.transition(belief.x, dt_s) } -> std::same_as<Eigen::Vector<double, Model::dim>>;
  { model.transition_jacobian(belief.x, dt_s) } -> std::same_as<Eigen::Matrix<double, Model::dim, Model::dim>>;
  { model.noise(dt_s) } -> std::same_as<Eigen::Matrix<double, Model::dim, Model::dim>>;
  { model.predicted(belief, dt_s) } -> std::same_as<Belief<Model::dim>>;
};

/// σ_a is defined as an acceleration that is constant for this long and then drawn anew: it moves the target as white
/// noise of density q = σ_a² · 0.05 s does.
inline constexpr double acceleration_hold_s = 0.05;

/// Constant velocity: F = [I, Δ; 0, I], Q = q [Δ³/3, Δ²/2; Δ²/2, Δ].
/// Bar-Shalom, Li & Kirubarajan, "Estimation with Applications to Tracking and Navigation", 2001, section 6.2.2.
struct ConstantVelocity {
  static constexpr int dim = 6;
  double sigma_a_m_s2 = 1.0;  ///< About the target's peak acceleration.

  [[nodiscard]] double density() const { return sigma_a_m_s2 * sigma_a_m_s2 * acceleration_hold_s; }
  [[nodiscard]] Eigen::Vector<double, 6> transition(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> transition_jacobian(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> noise(double dt_s) const;
  [[nodiscard]] Belief<6> predicted(const Belief<6>& belief, double dt_s) const;
};

/// Free fall: constant velocity with its noise, and the acceleration of gravity, known in the caller's frame.
struct Ballistic {
  static constexpr int dim = 6;
  double sigma_a_m_s2 = 1.0;                           ///< σ of accelerations other than gravity, above all drag.
  Eigen::Vector3d gravity_m_s2 = {0.0, 9.80665, 0.0};  ///< For a frame with y down.

  [[nodiscard]] Eigen::Vector<double, 6> transition(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> transition_jacobian(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> noise(double dt_s) const;
  [[nodiscard]] Belief<6> predicted(const Belief<6>& belief, double dt_s) const;
};

/// Velocity that returns to zero: dv = −v/τ dt + noise that keeps its σ at σ_v (Ornstein–Uhlenbeck process).
struct MeanReverting {
  static constexpr int dim = 6;
  double sigma_v_m_s = 0.9;
  double tau_s = 0.7;

  [[nodiscard]] Eigen::Vector<double, 6> transition(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> transition_jacobian(const Eigen::Vector<double, 6>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 6, 6> noise(double dt_s) const;
  [[nodiscard]] Belief<6> predicted(const Belief<6>& belief, double dt_s) const;
};

/// Acceleration that returns to zero: da = −a/τ dt + noise that keeps its σ at σ_a. State [p, v, a]. R. A. Singer,
/// "Estimating optimal tracking filter performance for manned maneuvering targets", 1970.
struct Singer {
  static constexpr int dim = 9;
  double sigma_a_m_s2 = 1.0;
  double tau_s = 0.5;

  [[nodiscard]] Eigen::Vector<double, 9> transition(const Eigen::Vector<double, 9>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 9, 9> transition_jacobian(const Eigen::Vector<double, 9>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 9, 9> noise(double dt_s) const;
  [[nodiscard]] Belief<9> predicted(const Belief<9>& belief, double dt_s) const;
};

/// Coordinated turn in space: dv = ω × v dt + noise, ω a random walk. State [p, v, ω], ω in rad/s.
/// Bar-Shalom, Li & Kirubarajan, 2001, section 11.7, in three dimensions.
struct CoordinatedTurn {
  static constexpr int dim = 9;
  double sigma_a_m_s2 = 0.3;                 ///< σ of accelerations other than the turn; 0.3 of constant velocity's.
  double turn_density_rad_s_per_rt_s = 2.0;  ///< Random walk of ω: its σ after one second.

  [[nodiscard]] Eigen::Vector<double, 9> transition(const Eigen::Vector<double, 9>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 9, 9> transition_jacobian(const Eigen::Vector<double, 9>& x, double dt_s) const;
  [[nodiscard]] Eigen::Matrix<double, 9, 9> noise(double dt_s) const;
  [[nodiscard]] Belief<9> predicted(const Belief<9>& belief, double dt_s) const;
};

static_assert(MotionModel<ConstantVelocity> && MotionModel<Ballistic> && MotionModel<MeanReverting> &&
              MotionModel<Singer> && MotionModel<CoordinatedTurn>);

}  // namespace alidade
