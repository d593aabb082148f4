#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/localize/saved_map.h"
#include "alidade/patches/reference_patch.h"

namespace alidade {

/// A feature of the map as the feature front end knows it: what it looked like, from where, and how often it was found
/// again.
struct Landmark {
  long id = 0;
  ReferencePatch patch;
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();  ///< Of the point from the patch's centre, as first seen.
  Rigid3 world_from_first_cam;
  Eigen::Matrix<double, 3, 2> surface_in_world = Eigen::Matrix<double, 3, 2>::Zero();  ///< Two directions along it.
  Eigen::Matrix2d J_first_px_surface = Eigen::Matrix2d::Identity();  ///< Of first_px by a move along them.
  double first_distance_m = 1.0;
  std::size_t first_step = 0;  ///< Of the path.
  bool is_known = false;
  bool is_saved = false;  ///< Of the map of an earlier run.
  int num_tried = 0, num_found = 0;
  long last_found = 0;  ///< Frame.
  Eigen::Vector2d last_px = Eigen::Vector2d::Zero();
};

/// A landmark as seen first, at a point of the world. Its surface is taken to face the camera, or to have the normal
/// given. `smoothed`: the image of smoothed_for_search(). None too near the image's edge, or where the lens does
/// not see the point.
[[nodiscard]] std::optional<Landmark> new_landmark(long id, const cv::Mat& smoothed, const Camera& camera,
                                                   const Rigid3& world_from_cam, const Eigen::Vector2d& px,
                                                   const Eigen::Vector3d& point_in_world,
                                                   const std::optional<Eigen::Vector3d>& normal_in_world = {});

/// How its surroundings have been rotated and stretched, as a map of offsets from the first image to one taken from
/// here. By the derivatives of the plane that it lies in: A = J₁ R₁ᵀ B (J₀ B)⁻¹.
[[nodiscard]] std::optional<Eigen::Matrix2d> here_from_first(const Landmark& landmark, const Camera& camera,
                                                             const Rigid3& world_from_cam,
                                                             const Eigen::Vector3d& point_in_world);

/// How a landmark looks, that is at this position by now and was seen first from there; and one that looks so.
[[nodiscard]] SavedLook look_of(const Landmark& landmark, const Eigen::Vector3d& point_in_world,
                                const Rigid3& world_from_first_cam);
[[nodiscard]] Landmark saved_landmark(long id, const SavedLook& look, const Eigen::Vector3d& point_in_world);

}  // namespace alidade
