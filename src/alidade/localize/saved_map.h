#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/localize/target.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// How a point of a map of images looked when it was first seen.
struct SavedLook {
  GreyPatch patch;                                      ///< Smoothed, as it is looked for.
  Eigen::Vector2d offset_px = Eigen::Vector2d::Zero();  ///< Of the point from the patch's centre.
  Rigid3 world_from_first_cam;
  Eigen::Matrix<double, 3, 2> surface_in_world = Eigen::Matrix<double, 3, 2>::Zero();  ///< Two directions along it.
  Eigen::Matrix2d J_first_px_surface = Eigen::Matrix2d::Identity();  ///< Of its first pixel by a move along them.
};

struct SavedPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  Eigen::Matrix3d cov = Eigen::Matrix3d::Zero();
  std::optional<SavedLook> look = {};
};

/// An image made very small, and where it was taken from.
struct SavedKeyframe {
  Rigid3 world_from_cam;
  GreyPatch thumbnail;
};

/// What all points of a map have in common of their errors: those of its frame, as of a target that it was made in
/// front of.
struct SavedFrame {
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  /// Of a translation of the map [m], a rotation about the centre [rad] and a change of size, relative.
  Eigen::Matrix<double, 7, 7> cov = Eigen::Matrix<double, 7, 7>::Zero();
};

/// The map of a run, for later runs to start in: `localize --map`.
struct SavedMap {
  bool is_in_metres = false;
  std::vector<SavedPoint> points = {};        ///< Their covariances are of errors beside the frame's.
  std::optional<SavedFrame> frame = {};       ///< None: not known.
  std::vector<SavedKeyframe> keyframes = {};  ///< Of images.
};

ALIDADE_PUBLIC_END
}  // namespace alidade
