#include "alidade/observe/filters/flow_regressor.h"

namespace alidade {
FlowRegressor flow_regressor(const Eigen::Vector2d& q, const Eigen::Vector3d& rate) {
  const double px = q.x(), py = q.y(), wx = rate.x(), wy = rate.y(), wz = rate.z();
  FlowRegressor g;
  g.col(0) << -px * px * wy, 2.0 * px * wy, 0.0, px * py * wx, -py * wx, -px * wx,  //
      -wy, wx, 0.0, 0.0, py * wz, -wz, 0.0, 0.0;
  g.col(1) << -px * py * wy, py * wy, px * wy, py * py * wx, 0.0, -2.0 * py * wx,  //
      0.0, 0.0, wx, -wy, 0.0, 0.0, -px * wz, wz;
  return g;
}

DifferenceRegressor difference_regressor(const Eigen::Vector2d& q, const Eigen::Vector2d& q_reference,
                                         const Eigen::Vector3d& rate) {
  return (flow_regressor(q, rate) - flow_regressor(q_reference, rate))(difference_rows, Eigen::all);
}

FlowParameters flow_parameters(const Eigen::Vector4d& k) {
  const double fx = k[0], fy = k[1], u = k[2], v = k[3];
  FlowParameters theta;
  theta << 1.0 / fx, u / fx, v / fx, 1.0 / fy, u / fy, v / fy,   //
      fx + u * u / fx, u * v / fy, fy + v * v / fy, u * v / fx,  //
      fx / fy, fx * v / fy, fy / fx, fy * u / fx;
  return theta;
}

Eigen::Matrix<double, 14, 4> flow_parameters_jacobian(const Eigen::Vector4d& k) {
  const double fx = k[0], fy = k[1], u = k[2], v = k[3];
  const double fx2 = fx * fx, fy2 = fy * fy;
  Eigen::Matrix<double, 14, 4> j;
  j << -1.0 / fx2, 0.0, 0.0, 0.0,                 //
      -u / fx2, 0.0, 1.0 / fx, 0.0,               //
      -v / fx2, 0.0, 0.0, 1.0 / fx,               //
      0.0, -1.0 / fy2, 0.0, 0.0,                  //
      0.0, -u / fy2, 1.0 / fy, 0.0,               //
      0.0, -v / fy2, 0.0, 1.0 / fy,               //
      1.0 - u * u / fx2, 0.0, 2.0 * u / fx, 0.0,  //
      0.0, -u * v / fy2, v / fy, u / fy,          //
      0.0, 1.0 - v * v / fy2, 0.0, 2.0 * v / fy,  //
      -u * v / fx2, 0.0, v / fx, u / fx,          //
      1.0 / fy, -fx / fy2, 0.0, 0.0,              //
      v / fy, -fx * v / fy2, 0.0, fx / fy,        //
      -fy / fx2, 1.0 / fx, 0.0, 0.0,              //
      -fy * u / fx2, u / fx, fy / fx, 0.0;
  return j;
}

DifferenceParameters difference_parameters(const Eigen::Vector4d& k) { return flow_parameters(k)(difference_rows); }

Eigen::Matrix<double, 8, 4> difference_parameters_jacobian(const Eigen::Vector4d& k) {
  return flow_parameters_jacobian(k)(difference_rows, Eigen::all);
}

std::optional<Eigen::Vector4d> intrinsics_of(const DifferenceParameters& theta, double least) {
  if (!(theta[0] > least && theta[3] > least)) return std::nullopt;
  const double norm2 = theta[0] * theta[0] + theta[3] * theta[3];
  const double u = (theta[1] * theta[0] + theta[4] * theta[3]) / norm2;
  const double v = (theta[2] * theta[0] + theta[5] * theta[3]) / norm2;
  return Eigen::Vector4d(1.0 / theta[0], 1.0 / theta[3], u, v);
}

Eigen::Matrix<double, 4, 8> intrinsics_jacobian(const DifferenceParameters& theta) {
  const double a = theta[0], b = theta[3], norm2 = a * a + b * b;
  const double u = (theta[1] * a + theta[4] * b) / norm2, v = (theta[2] * a + theta[5] * b) / norm2;
  Eigen::Matrix<double, 4, 8> j = Eigen::Matrix<double, 4, 8>::Zero();
  j(0, 0) = -1.0 / (a * a);
  j(1, 3) = -1.0 / (b * b);
  j(2, 0) = (theta[1] - 2.0 * a * u) / norm2;
  j(2, 1) = a / norm2;
  j(2, 3) = (theta[4] - 2.0 * b * u) / norm2;
  j(2, 4) = b / norm2;
  j(3, 0) = (theta[2] - 2.0 * a * v) / norm2;
  j(3, 2) = a / norm2;
  j(3, 3) = (theta[5] - 2.0 * b * v) / norm2;
  j(3, 5) = b / norm2;
  return j;
}

Eigen::Vector4d scaled_intrinsics(const PixelScale& scale, const Eigen::Vector4d& px) {
  return Eigen::Vector4d(px[0], px[1], px[2] - scale.centre.x(), px[3] - scale.centre.y()) / scale.scale;
}

Eigen::Vector4d intrinsics_in_px(const PixelScale& scale, const Eigen::Vector4d& k) {
  return scale.scale * k + Eigen::Vector4d(0.0, 0.0, scale.centre.x(), scale.centre.y());
}

}  // namespace alidade
