#include "alidade/report/view3.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

namespace alidade::report {

View3 View3::three_quarter() {
  constexpr double turn = 52.0 * std::numbers::pi / 180.0, lift = 22.0 * std::numbers::pi / 180.0;
  const Eigen::Vector3d onward(-std::sin(turn) * std::cos(lift), std::sin(lift), std::cos(turn) * std::cos(lift));
  View3 view;
  view.right_in_cam = Eigen::Vector3d(std::cos(turn), 0.0, std::sin(turn));
  view.down_in_cam = onward.cross(view.right_in_cam);
  return view;
}

View3 View3::from_above() {
  View3 view;
  view.right_in_cam = Eigen::Vector3d::UnitZ();
  view.down_in_cam = Eigen::Vector3d::UnitX();
  return view;
}

View3 View3::from_side() {
  View3 view;
  view.right_in_cam = Eigen::Vector3d::UnitZ();
  view.down_in_cam = Eigen::Vector3d::UnitY();
  return view;
}

void View3::fit(const std::vector<Eigen::Vector3d>& points_in_cam, Place corner, double width, double height) {
  Eigen::Vector2d low = Eigen::Vector2d::Constant(std::numeric_limits<double>::infinity()), high = -low;
  for (const Eigen::Vector3d& point : points_in_cam) {
    const Eigen::Vector2d flat(right_in_cam.dot(point), down_in_cam.dot(point));
    low = low.cwiseMin(flat);
    high = high.cwiseMax(flat);
  }
  if (!(low.allFinite() && high.allFinite())) return;
  const Eigen::Vector2d size = (high - low).cwiseMax(1e-6);
  scale = std::min(width / size.x(), height / size.y());
  x0 = corner.x + 0.5 * (width - scale * (low.x() + high.x()));
  y0 = corner.y + 0.5 * (height - scale * (low.y() + high.y()));
}

Place View3::at(const Eigen::Vector3d& point_in_cam) const {
  return {x0 + scale * right_in_cam.dot(point_in_cam), y0 + scale * down_in_cam.dot(point_in_cam)};
}

double View3::depth(const Eigen::Vector3d& point_in_cam) const {
  return right_in_cam.cross(down_in_cam).dot(point_in_cam);
}

}  // namespace alidade::report
