#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/localize/target.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Appearance of a point of a map of images when it was first seen.
struct SavedLook {
  GreyPatch patch;                                      ///< Smoothed, as it is searched for.
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();  ///< From the patch's centre to the point.
  Rigid3 world_from_first_cam;
  Eigen::Matrix<double, 3, 2> surface_in_world = Eigen::Matrix<double, 3, 2>::Zero();  ///< Two tangent directions.
  Eigen::Matrix2d J_first_px_surface = Eigen::Matrix2d::Identity();  ///< Derivative of its first pixel along them.
};

struct SavedPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  std::optional<SavedLook> look = {};
};

/// A thumbnail of an image, and the pose at which it was taken.
struct SavedKeyframe {
  Rigid3 world_from_cam;
  GreyPatch thumbnail;
};

/// Errors that all points of a map share: those of its frame, such as the errors of the target in front of which it was
/// made.
struct SavedFrame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  /// Covariance of a translation of the map [m], a rotation about the centre [rad] and a relative change of size.
  Eigen::Matrix<double, 7, 7> cov = Eigen::Matrix<double, 7, 7>::Zero();
};

/// The map of a run, in which later runs can start: `localize --map`.
struct SavedMap {
  bool is_in_metres = false;
  std::vector<SavedPoint> points = {};        ///< Their covariances exclude the frame's errors.
  std::optional<SavedFrame> frame = {};       ///< None: not known.
  std::vector<SavedKeyframe> keyframes = {};  ///< Keyframes of a map of images.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
