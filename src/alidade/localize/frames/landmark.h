#pragma once

#include <Eigen/Core>
#include <optional>

#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/localize/saved_map.h"
#include "alidade/patches/reference_patch.h"

namespace alidade {

/// A feature of the map as seen by the front end: its appearance, the pose from which it was first seen, and how often
/// it was found again.
struct Landmark {
  long id = 0;
  ReferencePatch patch;
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();  ///< Of the point from the patch's centre, at first sight.
  Rigid3 world_from_first_cam;
  Eigen::Matrix<double, 3, 2> surface_in_world = Eigen::Matrix<double, 3, 2>::Zero();  ///< Two directions along it.
  Eigen::Matrix2d J_first_px_surface = Eigen::Matrix2d::Identity();  ///< ∂first_px / ∂(move along them).
  double first_distance_m = 1.0;
  std::size_t first_step = 0;  ///< Index in the path.
  bool is_known = false;
  bool is_saved = false;  ///< From the map of an earlier run.
  int num_tried = 0, num_found = 0;
  long last_found = 0;  ///< Frame.
  Eigen::Vector2d last_px = Eigen::Vector2d::Zero();
};

/// Creates a landmark from its first image, at a point of the world. Its surface is assumed to face the camera, or to
/// have the given normal. `smoothed`: output of smoothed_for_search(). Empty if too near the edge of the image, or if
/// the point is outside the domain of the lens.
[[nodiscard]] std::optional<Landmark> new_landmark(long id, const cv::Mat& smoothed, const Camera& camera,
                                                   const Rigid3& world_from_cam, const Eigen::Vector2d& px,
                                                   const Eigen::Vector3d& point_in_world,
                                                   const std::optional<Eigen::Vector3d>& normal_in_world = {});

/// Warp of its surroundings: maps offsets in the first image to offsets in an image from this pose. Derived from the
/// plane in which it lies: A = J₁ R₁ᵀ B (J₀ B)⁻¹.
[[nodiscard]] std::optional<Eigen::Matrix2d> here_from_first(const Landmark& landmark, const Camera& camera,
                                                             const Rigid3& world_from_cam,
                                                             const Eigen::Vector3d& point_in_world);

/// Appearance of a landmark with its current position and first pose, for a saved map; and the landmark from it.
[[nodiscard]] SavedLook look_of(const Landmark& landmark, const Eigen::Vector3d& point_in_world,
                                const Rigid3& world_from_first_cam);
[[nodiscard]] Landmark saved_landmark(long id, const SavedLook& look, const Eigen::Vector3d& point_in_world);

}  // namespace alidade
