#include "alidade/localize/imu/imu_factors.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/so3_jacobian.h"

namespace alidade {
namespace {

using Matrix3 = Eigen::Matrix3d;
using Vector3 = Eigen::Vector3d;

/// A weighted step after correction, with its derivatives with respect to the biases and the clock.
struct Corrected {
  Vector3 value;
  Matrix3 by_rate, by_force;
  Vector3 by_time;
};

/// Weighted sum of velocity and position, in the axes of the given mounting, at the state's biases and clock.
Corrected corrected(const ImuStepAt& at, const ImuState::Bias& bias, double late_s, double of_velocity,
                    double of_position) {
  const ImuStep& step = at.step;
  Corrected out;
  out.by_rate = of_velocity * step.velocity_by_rate + of_position * step.position_by_rate;
  out.by_force = of_velocity * step.velocity_by_force + of_position * step.position_by_force;
  out.by_time = of_velocity * step.velocity_by_time + of_position * step.position_by_time;
  out.value = of_velocity * step.velocity + of_position * step.position + out.by_rate * (bias.rate - at.rate_bias) +
              out.by_force * (bias.force - at.force_bias) + late_s * out.by_time;
  return out;
}

void add_bias(const ImuState::Bias& bias, const Matrix3& by_rate, const Matrix3& by_force, ImuRows& rows) {
  for (int i = 0; i < 2; ++i) {
    const double share = i == 0 ? 1.0 - bias.share : bias.share;
    if (share == 0.0) continue;
    rows.J_imu.middleCols<3>(6 * (bias.node + i)) += share * by_rate;
    rows.J_imu.middleCols<3>(6 * (bias.node + i) + 3) += share * by_force;
  }
}

}  // namespace

ImuState::Bias ImuState::bias_at(double t_s) const {
  const auto after = std::ranges::upper_bound(node_t_s, t_s);
  const auto last = static_cast<std::ptrdiff_t>(node_t_s.size()) - 1;
  const std::ptrdiff_t before = std::clamp<std::ptrdiff_t>(after - node_t_s.begin() - 1, 0, last);
  const auto i = static_cast<std::size_t>(before), j = static_cast<std::size_t>(std::min(before + 1, last));
  Bias bias{rate_bias[i], force_bias[i], static_cast<int>(before), 0.0};
  if (i == j || !(node_t_s[j] > node_t_s[i])) return bias;
  bias.share = std::clamp((t_s - node_t_s[i]) / (node_t_s[j] - node_t_s[i]), 0.0, 1.0);
  bias.rate += bias.share * (rate_bias[j] - rate_bias[i]);
  bias.force += bias.share * (force_bias[j] - force_bias[i]);
  return bias;
}

ImuState ImuState::moved(const Eigen::VectorXd& by) const {
  ImuState out = *this;
  for (std::size_t i = 0; i < node_t_s.size(); ++i) {
    out.rate_bias[i] += by.segment<3>(6 * static_cast<Eigen::Index>(i));
    out.force_bias[i] += by.segment<3>(6 * static_cast<Eigen::Index>(i) + 3);
  }
  out.gravity_in_world += by.segment<3>(gravity_at());
  out.turn = (exp_so3(by.segment<3>(turn_at())) * turn).normalized();
  out.imu_in_cam += by.segment<3>(place_at());
  out.late_s += by[late_at()];
  out.clock_rate += by[clock_rate_at()];
  out.force_scale += by[scale_at()];
  for (Eigen::Index i = 0; i < 9; ++i) out.force_axes(i / 3, i % 3) += by[force_axes_at() + i];
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3, k = (i + 2) % 3;
    out.rate_axes(i, i) += by[rate_axes_at() + i];
    out.rate_axes(j, k) += by[rate_axes_at() + 3 + i];
    out.rate_axes(k, j) += by[rate_axes_at() + 3 + i];
  }
  return out;
}

ImuRows rotation_rows(const ImuStepAt& at, std::span<const Rigid3, 2> world_from_cam, const ImuState& imu) {
  const ImuStep& step = at.step;
  const ImuState::Bias bias = imu.bias_at(at.t_s);
  const Vector3 rotated = log_so3(step.rotation);
  const Vector3 more = step.rotation_by_rate * (bias.rate - at.rate_bias) +
                       imu.late_at_time(at.t_s) * step.rotation_by_time + imu.rate_axes * rotated;
  const Eigen::Quaterniond in_imu = step.rotation * exp_so3(more);
  const Eigen::Quaterniond read = imu.turn * in_imu * imu.turn.conjugate();
  const Eigen::Quaterniond between_them = world_from_cam[0].rotation.conjugate() * world_from_cam[1].rotation;
  const Eigen::Quaterniond E = read.conjugate() * between_them;
  ImuRows rows{log_so3(E), Eigen::Matrix<double, 3, 18>::Zero(),
               Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, imu.dim())};
  const Matrix3 inverse = right_jacobian(rows.error).inverse();
  rows.J_poses.middleCols<3>(3) = -inverse * between_them.toRotationMatrix().transpose();
  rows.J_poses.middleCols<3>(9) = inverse;
  // A right perturbation δ of `read` changes the error by −J⁻¹ Eᵀ δ.
  const Matrix3 by_read = -inverse * E.toRotationMatrix().transpose();
  const Matrix3 turn = imu.turn.toRotationMatrix();
  const Matrix3 by_more = by_read * turn * right_jacobian(more);
  add_bias(bias, by_more * step.rotation_by_rate, Matrix3::Zero(), rows);
  rows.J_imu.col(imu.late_at()) = by_more * step.rotation_by_time;
  rows.J_imu.col(imu.clock_rate_at()) = imu.since_middle_s(at.t_s) * rows.J_imu.col(imu.late_at());
  for (Eigen::Index i = 0; i < 3; ++i) {
    const Eigen::Index j = (i + 1) % 3, k = (i + 2) % 3;
    rows.J_imu.col(imu.rate_axes_at() + i) = by_more.col(i) * rotated[i];
    rows.J_imu.col(imu.rate_axes_at() + 3 + i) = by_more.col(j) * rotated[k] + by_more.col(k) * rotated[j];
  }
  rows.J_imu.middleCols<3>(imu.turn_at()) = by_read * (read.toRotationMatrix().transpose() - Matrix3::Identity());
  return rows;
}

ImuRows force_rows(const ImuStepAt& first, const ImuStepAt& second, std::span<const Rigid3, 3> world_from_cam,
                   const ImuState& imu) {
  const double dt1 = first.step.dt_s, dt2 = second.step.dt_s, half = 0.5 * (dt1 + dt2);
  std::array<Matrix3, 3> R;
  std::array<Vector3, 3> q;
  for (std::size_t i = 0; i < 3; ++i) {
    R[i] = world_from_cam[i].rotation.toRotationMatrix();
    q[i] = world_from_cam[i].translation + R[i] * imu.imu_in_cam;
  }
  const Matrix3 turn = imu.turn.toRotationMatrix(), R0t = R[0].transpose(), R01 = R0t * R[1];
  const Matrix3 T = turn * (Matrix3::Identity() + imu.force_axes);
  const double scale = 1.0 + imu.force_scale;
  const ImuState::Bias bias1 = imu.bias_at(first.t_s), bias2 = imu.bias_at(second.t_s);
  const Corrected m1 = corrected(first, bias1, imu.late_at_time(first.t_s), 1.0, -1.0 / dt1);
  const Corrected m2 = corrected(second, bias2, imu.late_at_time(second.t_s), 0.0, 1.0 / dt2);
  const Vector3 in_first = T * m1.value, in_second = T * m2.value;  // in the camera's axes
  const Vector3 change = (q[2] - q[1]) / dt2 - (q[1] - q[0]) / dt1 - half * imu.gravity_in_world;
  const Vector3 left = R0t * change - scale * (R01 * in_second);
  ImuRows rows{left - scale * in_first, Eigen::Matrix<double, 3, 18>::Zero(),
               Eigen::Matrix<double, 3, Eigen::Dynamic>::Zero(3, imu.dim())};
  const Matrix3 arm = cross_matrix(imu.imu_in_cam);
  const double both = 1.0 / dt1 + 1.0 / dt2;
  rows.J_poses.middleCols<3>(0) = R0t / dt1;
  rows.J_poses.middleCols<3>(3) = cross_matrix(left) - arm / dt1;
  rows.J_poses.middleCols<3>(6) = -both * R0t;
  rows.J_poses.middleCols<3>(9) = both * R01 * arm + scale * R01 * cross_matrix(in_second);
  rows.J_poses.middleCols<3>(12) = R0t / dt2;
  rows.J_poses.middleCols<3>(15) = -(R0t * R[2]) * arm / dt2;
  add_bias(bias1, -scale * T * m1.by_rate, -scale * T * m1.by_force, rows);
  add_bias(bias2, -scale * R01 * T * m2.by_rate, -scale * R01 * T * m2.by_force, rows);
  rows.J_imu.middleCols<3>(imu.gravity_at()) = -half * R0t;
  rows.J_imu.middleCols<3>(imu.turn_at()) = scale * (cross_matrix(in_first) + R01 * cross_matrix(in_second));
  rows.J_imu.middleCols<3>(imu.place_at()) = (R0t * R[2] - R01) / dt2 - (R01 - Matrix3::Identity()) / dt1;
  rows.J_imu.col(imu.late_at()) = -scale * (T * m1.by_time + R01 * T * m2.by_time);
  rows.J_imu.col(imu.clock_rate_at()) =
      -scale * (imu.since_middle_s(first.t_s) * T * m1.by_time + imu.since_middle_s(second.t_s) * R01 * T * m2.by_time);
  rows.J_imu.col(imu.scale_at()) = -in_first - R01 * in_second;
  const Matrix3 second_turn = R01 * turn;
  for (Eigen::Index i = 0; i < 9; ++i)
    rows.J_imu.col(imu.force_axes_at() + i) =
        -scale * (turn.col(i / 3) * m1.value[i % 3] + second_turn.col(i / 3) * m2.value[i % 3]);
  return rows;
}

double rotation_variance(const ImuStep& step, const ImuNoise& noise) {
  return noise.rate_density * noise.rate_density * step.dt_s;
}

double force_variance(const ImuStep& first, const ImuStep& second, const ImuNoise& noise) {
  const double of_force = noise.force_density * noise.force_density * 0.5 * (first.dt_s + second.dt_s);
  // Within a step the force is rotated by the gyroscope only.
  constexpr double usual_force_m_s2 = 9.8;
  const double tilt = usual_force_m_s2 * noise.rate_density;
  return of_force + tilt * tilt * (std::pow(first.dt_s, 3) + std::pow(second.dt_s, 3)) / 3.0;
}

}  // namespace alidade
