#include "alidade/localize/map/map_frame.h"

#include "alidade/geometry/so3.h"

namespace alidade {

Eigen::Matrix<double, 3, 7> similarity_moves(const Eigen::Vector3d& away) {
  Eigen::Matrix<double, 3, 7> G;
  G << Eigen::Matrix3d::Identity(), -cross_matrix(away), away;
  return G;
}

SavedFrame about_centre(const SavedFrame& frame, const Eigen::Vector3d& centre) {
  Eigen::Matrix<double, 7, 7> there = Eigen::Matrix<double, 7, 7>::Identity();
  there.topRows<3>() = similarity_moves(centre - frame.centre);
  return {centre, there * frame.cov * there.transpose()};
}

SavedFrame scaled_frame(SavedFrame frame, double scale, double sigma_rel) {
  Eigen::Vector<double, 7> to_unit = Eigen::Vector<double, 7>::Ones(), size = Eigen::Vector<double, 7>::Zero();
  to_unit.head<3>().setConstant(scale);
  frame.centre *= scale;
  size.head<3>() = frame.centre;
  size[6] = 1.0;
  frame.cov = to_unit.asDiagonal() * frame.cov * to_unit.asDiagonal();
  frame.cov += sigma_rel * sigma_rel * size * size.transpose();
  return frame;
}

void widen_by_frame(const SavedFrame& frame, Localization& result) {
  for (PathStep& step : result.path) {
    if (!step.has_pose()) continue;
    const Eigen::Matrix3d cam_from_world = step.world_from_cam.rotation.conjugate().toRotationMatrix();
    Eigen::Matrix<double, 6, 7> G = Eigen::Matrix<double, 6, 7>::Zero();
    G.topRows<3>() = cam_from_world * similarity_moves(step.world_from_cam.translation - frame.centre);
    G.block<3, 3>(3, 3) = cam_from_world;
    step.cov += G * frame.cov * G.transpose();
  }
  for (MapPoint& point : result.map) {
    if (!point.cov_in_map) point.cov_in_map = point.cov;
    const Eigen::Matrix<double, 3, 7> G = similarity_moves(point.point_in_world - frame.centre);
    point.cov += G * frame.cov * G.transpose();
  }
  std::optional<SavedFrame>& own = result.saved_map.frame;
  if (own)
    own->cov += about_centre(frame, own->centre).cov;
  else
    own = frame;
}

}  // namespace alidade
