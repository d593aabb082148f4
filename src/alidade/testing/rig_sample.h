#pragma once

#include <map>

#include "alidade/geometry/so3.h"
#include "alidade/rig/rig.h"

namespace alidade::testing {

inline std::map<int, Camera> cameras_of(const Rig& rig) {
  std::map<int, Camera> cameras;
  for (const RigHead& rig_head : rig.heads) cameras[rig_head.head.id] = rig_head.camera;
  return cameras;
}

/// ξ of the pose of the second camera in the first, at these readings, against the truth.
inline Eigen::Matrix<double, 6, 1> error_between(const Rig& rig, const Rig& truth, const Eigen::Vector2d& first,
                                                 const Eigen::Vector2d& second) {
  const auto cam_from_cam = [&](const Rig& of) {
    return cam_from_world(of.heads[0].head, first) * world_from_cam(of.heads[1].head, second);
  };
  const Rigid3 a = cam_from_cam(rig), b = cam_from_cam(truth);
  Eigen::Matrix<double, 6, 1> xi;
  xi << b.rotation.conjugate() * (a.translation - b.translation), log_so3(b.rotation.conjugate() * a.rotation);
  return xi;
}

}  // namespace alidade::testing
