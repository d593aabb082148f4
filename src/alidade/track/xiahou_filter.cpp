#include "alidade/track/xiahou_filter.h"

#include <Eigen/LU>
#include <cmath>

namespace alidade {

XiahouFilter::XiahouFilter(const XiahouConfig& config, const Eigen::Vector3d& start_cm) : config_(config) {
  state_.x << start_cm.x(), 0.0, start_cm.y(), 0.0, start_cm.z(), 0.0;
}

void XiahouFilter::step(const Eigen::Vector4d& measured, double dt_s) {
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity(), Q = F;
  Eigen::Matrix<double, 6, 3> G = Eigen::Matrix<double, 6, 3>::Zero();
  for (int axis = 0; axis < 3; ++axis) {
    F(2 * axis, 2 * axis + 1) = dt_s;
    G(2 * axis, axis) = 0.5 * dt_s * dt_s;
    G(2 * axis + 1, axis) = dt_s;
  }
  if (config_.process_by_acceleration) Q = G * G.transpose();
  state_.x = (F * state_.x).eval();
  state_.P = (F * state_.P * F.transpose()).eval() + config_.process_variance * Q;
  const double x = state_.x[0], y = state_.x[2], z = state_.x[4];
  const Eigen::Vector4d expected(x / z, (config_.baseline_cm - x) / z, -y, -y);
  Eigen::Matrix<double, 4, 6> H = Eigen::Matrix<double, 4, 6>::Zero();
  H(0, 0) = 1.0 / z;
  H(0, 4) = -x / (z * z);
  H(1, 0) = -1.0 / z;
  H(1, 4) = -(config_.baseline_cm - x) / (z * z);
  H(2, 2) = H(3, 2) = -1.0;
  const Eigen::Vector4d variances(config_.variance_of_tangent, config_.variance_of_tangent, config_.variance_of_cm,
                                  config_.variance_of_cm);
  const Eigen::Matrix<double, 6, 4> PHt = state_.P * H.transpose();
  Eigen::Matrix4d S = H * PHt;
  S.diagonal() += variances;
  const Eigen::Matrix<double, 6, 4> K = PHt * S.inverse();
  state_.x += K * (measured - expected);
  const Eigen::Matrix<double, 6, 6> P = state_.P - K * PHt.transpose();
  state_.P = 0.5 * (P + P.transpose());
}

std::optional<Eigen::Vector4d> pseudo_measurement(const Eigen::Vector2d& first_rad, const Eigen::Vector2d& second_rad,
                                                  double baseline_cm) {
  const double k1 = std::tan(-first_rad.x()), k2 = std::tan(second_rad.x());
  if (!(k1 + k2 > 1e-3)) return std::nullopt;
  const double depth_cm = baseline_cm / (k1 + k2);
  return Eigen::Vector4d(k1, k2, depth_cm * std::tan(first_rad.y()) / std::cos(first_rad.x()),
                         depth_cm * std::tan(second_rad.y()) / std::cos(second_rad.x()));
}

Eigen::Vector3d position_of_pseudo_measurement(const Eigen::Vector4d& k, double baseline_cm) {
  const double depth_cm = baseline_cm / (k[0] + k[1]);
  return {depth_cm * k[0], -0.5 * (k[2] + k[3]), depth_cm};
}

}  // namespace alidade
