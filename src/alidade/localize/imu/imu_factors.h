#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/imu/preintegration.h"

// IMU factors on a path's poses. Readings are in axes of the camera (rotated by the mounting); velocities are
// eliminated: positions of three poses, and two steps between them, give one equation for the specific force.

namespace alidade {

/// Corrections of an IMU's readings, all in the camera's axes, and gravity in the world frame: estimated with a path.
/// Biases are piecewise linear in time between nodes.
struct ImuState {
  std::vector<double> node_t_s;
  std::vector<Eigen::Vector3d> rate_bias, force_bias;
  Eigen::Vector3d gravity_in_world = Eigen::Vector3d::Zero();
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< From the axes of the given mounting to the true ones.
  Eigen::Vector3d imu_in_cam = Eigen::Vector3d::Zero();
  double late_s = 0.0;       ///< IMU clock minus camera clock, beyond the shift already applied to the readings.
  double clock_rate = 0.0;   ///< Relative rate error (positive: fast), about the middle of the path, beyond the same.
  double force_scale = 0.0;  ///< True force over the reading, minus 1.
  /// Errors of the axes: forces are (I + A) times the readings, times the scale; rates are (I + A) times the readings.
  /// For rates A is symmetric, as their rotation is `turn`; for forces its trace is zero, as that is the scale.
  Eigen::Matrix3d force_axes = Eigen::Matrix3d::Zero(), rate_axes = Eigen::Matrix3d::Zero();

  [[nodiscard]] int dim() const { return 6 * static_cast<int>(node_t_s.size()) + 27; }
  /// Offsets in the vector of all parameters: rate and force bias of each node, then the constant ones.
  [[nodiscard]] int gravity_at() const { return 6 * static_cast<int>(node_t_s.size()); }
  [[nodiscard]] int turn_at() const { return gravity_at() + 3; }
  [[nodiscard]] int place_at() const { return gravity_at() + 6; }
  [[nodiscard]] int late_at() const { return gravity_at() + 9; }
  [[nodiscard]] int scale_at() const { return gravity_at() + 10; }
  [[nodiscard]] int force_axes_at() const { return gravity_at() + 11; }  ///< Row by row.
  [[nodiscard]] int rate_axes_at() const { return gravity_at() + 20; }   ///< The diagonal, then yz, xz, xy.
  [[nodiscard]] int clock_rate_at() const { return gravity_at() + 26; }

  /// Time since the middle of the path.
  [[nodiscard]] double since_middle_s(double t_s) const { return t_s - 0.5 * (node_t_s.front() + node_t_s.back()); }
  [[nodiscard]] double late_at_time(double t_s) const { return late_s + clock_rate * since_middle_s(t_s); }

  /// The biases at a time, with the node before it and interpolation weights.
  struct Bias {
    Eigen::Vector3d rate, force;
    int node = 0;
    double share = 0.0;  ///< Weight of the node after it.
  };
  [[nodiscard]] Bias bias_at(double t_s) const;
  [[nodiscard]] ImuState moved(const Eigen::VectorXd& by) const;
};

/// An IMU step, with the biases at which it was preintegrated.
struct ImuStepAt {
  ImuStep step;
  double t_s = 0.0;  ///< Time of its middle.
  Eigen::Vector3d rate_bias = Eigen::Vector3d::Zero(), force_bias = Eigen::Vector3d::Zero();
};

/// A residual of three rows, with its derivatives with respect to three poses (position in the world, rotation on the
/// right) and to the parameters of an ImuState.
struct ImuRows {
  Eigen::Vector3d error;
  Eigen::Matrix<double, 3, 18> J_poses = Eigen::Matrix<double, 3, 18>::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> J_imu;
};

/// Residual Log(ΔRᵀ R_kᵀ R_{k+1}) [rad].
[[nodiscard]] ImuRows rotation_rows(const ImuStepAt& step, std::span<const Rigid3, 2> world_from_cam,
                                    const ImuState& imu);

/// R_kᵀ ((q″ − q′)/Δ′ − (q′ − q)/Δ − g (Δ + Δ′)/2 − R_{k+1} p′/Δ′) − (v − p/Δ) with the IMU's positions q [m/s]: the
/// change of velocity between two steps, minus that from the specific forces in both.
[[nodiscard]] ImuRows force_rows(const ImuStepAt& first, const ImuStepAt& second,
                                 std::span<const Rigid3, 3> world_from_cam, const ImuState& imu);

/// Variance of each row by white noise. Neighbouring equations share a step, and a quarter of their noise; the variance
/// is that for slow accelerations, so faster ones are more certain than stated.
[[nodiscard]] double rotation_variance(const ImuStep& step, const ImuNoise& noise);
[[nodiscard]] double force_variance(const ImuStep& first, const ImuStep& second, const ImuNoise& noise);

}  // namespace alidade
