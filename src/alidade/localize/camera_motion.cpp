#include "alidade/localize/camera_motion.h"

namespace alidade {

CameraMotion moved(const CameraMotion& motion, double dt_s) {
  CameraMotion later = motion;
  later.world_from_cam.translation += motion.velocity_in_world * dt_s;
  later.world_from_cam.rotation = (motion.world_from_cam.rotation * exp_so3(motion.rate_in_cam * dt_s)).normalized();
  return later;
}

MotionJacobians motion_jacobians(const CameraMotion& motion, double dt_s) {
  const Eigen::Vector3d phi = motion.rate_in_cam * dt_s;
  const Eigen::Matrix3d I = Eigen::Matrix3d::Identity(), J = right_jacobian(phi) * dt_s;
  MotionJacobians out{MotionMatrix::Identity(), Eigen::Matrix<double, motion_dim, 6>::Zero()};
  out.F.block<3, 3>(0, 6) = dt_s * I;
  out.F.block<3, 3>(3, 3) = exp_so3(phi).toRotationMatrix().transpose();
  out.F.block<3, 3>(3, 9) = J;
  out.G.block<3, 3>(0, 0) = dt_s * I;
  out.G.block<3, 3>(3, 3) = J;
  out.G.block<3, 3>(6, 0) = I;
  out.G.block<3, 3>(9, 3) = I;
  return out;
}

MotionMatrix motion_noise(const MotionJacobians& jacobians, double sigma_a_m_s2, double sigma_alpha_rad_s2,
                          double dt_s) {
  Eigen::Vector<double, 6> sigma;
  sigma << Eigen::Vector3d::Constant(sigma_a_m_s2 * dt_s), Eigen::Vector3d::Constant(sigma_alpha_rad_s2 * dt_s);
  const Eigen::Matrix<double, motion_dim, 6> L = jacobians.G * sigma.asDiagonal();
  return L * L.transpose();
}

CameraMotion retract(const CameraMotion& motion, const Eigen::Vector<double, motion_dim>& error) {
  CameraMotion result = motion;
  result.world_from_cam.translation += error.head<3>();
  result.world_from_cam.rotation = (motion.world_from_cam.rotation * exp_so3(error.segment<3>(3))).normalized();
  result.velocity_in_world += error.segment<3>(6);
  result.rate_in_cam += error.tail<3>();
  return result;
}

Eigen::Vector<double, 6> pose_difference(const Rigid3& to, const Rigid3& from) {
  Eigen::Vector<double, 6> difference;
  difference << to.translation - from.translation, log_so3(from.rotation.conjugate() * to.rotation);
  return difference;
}

}  // namespace alidade
