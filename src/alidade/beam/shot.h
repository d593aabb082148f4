#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "alidade/board/board_pose.h"
#include "alidade/board/board_view.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Plane n · point_in_cam + d = 0.
struct Plane {
  Eigen::Vector3d normal_in_cam = Eigen::Vector3d::UnitZ();  ///< Unit vector.
  double d_m = 0.0;
  Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();  ///< Covariance of (normal, d); zero: exact.
};

/// The board's plane z = 0, oriented away from the camera: d < 0.
[[nodiscard]] inline Plane plane_of(const Rigid3& cam_from_board) {
  Plane plane;
  plane.normal_in_cam = cam_from_board.rotation * Eigen::Vector3d::UnitZ();
  plane.d_m = -plane.normal_in_cam.dot(cam_from_board.translation);
  if (plane.d_m > 0.0) {
    plane.normal_in_cam = -plane.normal_in_cam;
    plane.d_m = -plane.d_m;
  }
  return plane;
}

/// An observed laser spot.
struct Spot {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Distorted pixel, as in the photo.
  std::optional<double> sigma_px = {};           ///< σ of one coordinate.
  bool sigma_is_least = false;  ///< A lower bound: what the detector knows of; speckle, Bayer and JPEG add to it.
};

/// One reading of the rangefinder and its observations. At most one observation of the board is needed: its corners,
/// pose or plane; the first one present, in that order, is used.
struct Shot {
  double range_m = 0.0;
  std::optional<double> sigma_range_m = {};
  std::optional<Spot> spot = {};
  std::optional<BoardView> board = {};
  std::optional<BoardPose> pose = {};
  std::optional<Plane> plane = {};
  std::string name = {};  ///< For display: a table row or a photo.
  /// File names, as in the table, of the photos with the laser on and, if there is one, off. Empty: none.
  std::string photo = {}, photo_off = {};
  std::string no_board = {};  ///< Why the photo shows no board, where known.
  std::string table = {};     ///< The table that the shot was read from, and its line there; empty: not from a file.
  std::size_t line = 0;

  [[nodiscard]] bool has_plane() const { return board || pose || plane; }
};

ALIDADE_PUBLIC_END
}  // namespace alidade
