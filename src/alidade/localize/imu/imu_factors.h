#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/imu/preintegration.h"

// What an IMU says of a path's poses. Its readings are in axes of the camera (rotated by the mounting); velocities are
// eliminated: positions of three poses, and two steps between them, leave one equation for the specific force.

namespace alidade {

/// What an IMU's readings are corrected by, all in the camera's axes, and the world's gravity: estimated with a path.
/// Biases are piecewise linear in time between nodes.
struct ImuState {
  std::vector<double> node_t_s;
  std::vector<Eigen::Vector3d> rate_bias, force_bias;
  Eigen::Vector3d gravity_in_world = Eigen::Vector3d::Zero();
  Eigen::Quaterniond turn = Eigen::Quaterniond::Identity();  ///< From the axes of the given mounting to the true ones.
  Eigen::Vector3d imu_in_cam = Eigen::Vector3d::Zero();
  double late_s = 0.0;       ///< The IMU's clock less the camera's, beyond what its readings were shifted by.
  double clock_rate = 0.0;   ///< By which it runs fast, about the middle of the path, beyond the same.
  double force_scale = 0.0;  ///< True force over the read one, less 1.
  /// What the axes are otherwise: forces are (I + A) those read, times the scale; rates (I + A) those read. Of rates it
  /// is symmetric, as their rotation is `turn`; of forces its trace is zero, as that is the scale.
  Eigen::Matrix3d force_axes = Eigen::Matrix3d::Zero(), rate_axes = Eigen::Matrix3d::Zero();

  [[nodiscard]] int dim() const { return 6 * static_cast<int>(node_t_s.size()) + 27; }
  /// Where in the vector of all these numbers each stands: of a node rate and force, then what does not vary.
  [[nodiscard]] int gravity_at() const { return 6 * static_cast<int>(node_t_s.size()); }
  [[nodiscard]] int turn_at() const { return gravity_at() + 3; }
  [[nodiscard]] int place_at() const { return gravity_at() + 6; }
  [[nodiscard]] int late_at() const { return gravity_at() + 9; }
  [[nodiscard]] int scale_at() const { return gravity_at() + 10; }
  [[nodiscard]] int force_axes_at() const { return gravity_at() + 11; }  ///< Row by row.
  [[nodiscard]] int rate_axes_at() const { return gravity_at() + 20; }   ///< The diagonal, then yz, xz, xy.
  [[nodiscard]] int clock_rate_at() const { return gravity_at() + 26; }

  /// Since the middle of the path.
  [[nodiscard]] double since_middle_s(double t_s) const { return t_s - 0.5 * (node_t_s.front() + node_t_s.back()); }
  [[nodiscard]] double late_at_time(double t_s) const { return late_s + clock_rate * since_middle_s(t_s); }

  /// The biases at a time, and by how much the node before it and the one after it count.
  struct Bias {
    Eigen::Vector3d rate, force;
    int node = 0;
    double share = 0.0;  ///< Of the node after it.
  };
  [[nodiscard]] Bias bias_at(double t_s) const;
  [[nodiscard]] ImuState moved(const Eigen::VectorXd& by) const;
};

/// A step of an IMU, with the biases that it was integrated by.
struct ImuStepAt {
  ImuStep step;
  double t_s = 0.0;  ///< Its middle.
  Eigen::Vector3d rate_bias = Eigen::Vector3d::Zero(), force_bias = Eigen::Vector3d::Zero();
};

/// An equation of three rows: its error, and its derivatives by three poses (position in the world, rotation on the
/// right) and by an ImuState's numbers.
struct ImuRows {
  Eigen::Vector3d error;
  Eigen::Matrix<double, 3, 18> J_poses = Eigen::Matrix<double, 3, 18>::Zero();
  Eigen::Matrix<double, 3, Eigen::Dynamic> J_imu;
};

/// Log(ΔRᵀ R_kᵀ R_{k+1}) [rad].
[[nodiscard]] ImuRows rotation_rows(const ImuStepAt& step, std::span<const Rigid3, 2> world_from_cam,
                                    const ImuState& imu);

/// R_kᵀ ((q″ − q′)/Δ′ − (q′ − q)/Δ − g (Δ + Δ′)/2 − R_{k+1} p′/Δ′) − (v − p/Δ) of the IMU's positions q [m/s]: the
/// change of speed between two steps, less what the forces of the two make of it.
[[nodiscard]] ImuRows force_rows(const ImuStepAt& first, const ImuStepAt& second,
                                 std::span<const Rigid3, 3> world_from_cam, const ImuState& imu);

/// Variances of each of their rows: of white noise. Neighbouring equations share a step, and a quarter of their noise;
/// the variance is that of slow accelerations, from which faster ones differ by being surer.
[[nodiscard]] double rotation_variance(const ImuStep& step, const ImuNoise& noise);
[[nodiscard]] double force_variance(const ImuStep& first, const ImuStep& second, const ImuNoise& noise);

}  // namespace alidade
