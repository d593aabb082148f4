#include "alidade/localize/frames/landmark.h"

#include <Eigen/Geometry>
#include <Eigen/LU>
#include <opencv2/core.hpp>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// J Rᵀ B: derivative of the pixel with respect to the point's position along its surface.
std::optional<Eigen::Matrix2d> J_px_surface(const Camera& camera, const Rigid3& world_from_cam,
                                            const Eigen::Vector3d& point_in_world,
                                            const Eigen::Matrix<double, 3, 2>& surface_in_world) {
  const Rigid3 cam_from_world = world_from_cam.inverse();
  const auto seen = project_with_jacobians(camera, cam_from_world * point_in_world);
  if (!seen) return std::nullopt;
  return seen->J_px_point * (cam_from_world.rotation.toRotationMatrix() * surface_in_world);
}

}  // namespace

std::optional<Landmark> new_landmark(long id, const cv::Mat& smoothed, const Camera& camera,
                                     const Rigid3& world_from_cam, const Eigen::Vector2d& px,
                                     const Eigen::Vector3d& point_in_world,
                                     const std::optional<Eigen::Vector3d>& normal_in_world) {
  const Eigen::Vector2i centre = px.array().round().cast<int>();
  if (centre.minCoeff() < ReferencePatch::margin_px || centre.x() >= smoothed.cols - ReferencePatch::margin_px ||
      centre.y() >= smoothed.rows - ReferencePatch::margin_px)
    return std::nullopt;
  Landmark landmark;
  landmark.id = id;
  landmark.patch = ReferencePatch(smoothed, centre.x(), centre.y());
  if (!landmark.patch.seen_through(Eigen::Matrix2d::Identity())) return std::nullopt;
  landmark.offset_px = px - centre.cast<double>();
  landmark.world_from_first_cam = world_from_cam;
  const Eigen::Vector3d observation = point_in_world - world_from_cam.translation;
  landmark.first_distance_m = observation.norm();
  landmark.surface_in_world = two_across(normal_in_world.value_or(observation).normalized());
  const auto J = J_px_surface(camera, world_from_cam, point_in_world, landmark.surface_in_world);
  if (!J || !(std::abs(J->determinant()) > 0.0)) return std::nullopt;
  landmark.J_first_px_surface = *J;
  return landmark;
}

std::optional<Eigen::Matrix2d> here_from_first(const Landmark& landmark, const Camera& camera,
                                               const Rigid3& world_from_cam, const Eigen::Vector3d& point_in_world) {
  const auto J = J_px_surface(camera, world_from_cam, point_in_world, landmark.surface_in_world);
  if (!J) return std::nullopt;
  // Derivatives at the first view scale with 1/distance, and the distance is known better now.
  const double distance_m = (point_in_world - landmark.world_from_first_cam.translation).norm();
  return *J * landmark.J_first_px_surface.inverse() * (distance_m / landmark.first_distance_m);
}

SavedLook look_of(const Landmark& landmark, const Eigen::Vector3d& point_in_world, const Rigid3& world_from_first_cam) {
  SavedLook look;
  const auto grey = landmark.patch.grey();
  look.patch = {ReferencePatch::side_px, ReferencePatch::side_px, {grey.begin(), grey.end()}};
  look.offset_px = landmark.offset_px;
  look.world_from_first_cam = world_from_first_cam;
  const Eigen::Quaterniond turned = world_from_first_cam.rotation * landmark.world_from_first_cam.rotation.conjugate();
  look.surface_in_world = turned.toRotationMatrix() * landmark.surface_in_world;
  const double distance_m = (point_in_world - world_from_first_cam.translation).norm();
  look.J_first_px_surface = landmark.J_first_px_surface * (landmark.first_distance_m / distance_m);
  return look;
}

Landmark saved_landmark(long id, const SavedLook& look, const Eigen::Vector3d& point_in_world) {
  Landmark landmark;
  landmark.id = id;
  landmark.patch = ReferencePatch(
      std::span<const std::uint8_t, ReferencePatch::area_px>(look.patch.grey.data(), ReferencePatch::area_px));
  landmark.offset_px = look.offset_px;
  landmark.world_from_first_cam = look.world_from_first_cam;
  landmark.surface_in_world = look.surface_in_world;
  landmark.J_first_px_surface = look.J_first_px_surface;
  landmark.first_distance_m = (point_in_world - look.world_from_first_cam.translation).norm();
  landmark.is_known = landmark.is_saved = true;
  return landmark;
}

}  // namespace alidade
