#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// A point whose position is known; known points define scale and frame.
struct KnownPoint {
  long id = 0;
  Eigen::Vector3d point_in_world = Eigen::Vector3d::Zero();
  double sigma_m = 0.001;  ///< σ of each coordinate.
};

/// A small grey image of a point as first seen; the point is at its centre.
struct GreyPatch {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> grey;  ///< Row-major.
};

/// What defines the scale and the map's frame. Observations need `points` only; in images the points are detected as
/// the corners of a rectangle or of a board, or by their patches.
struct LocalizeTarget {
  std::vector<KnownPoint> points = {};              ///< Empty: no target.
  std::optional<Eigen::Vector2d> rectangle_m = {};  ///< Width and height. See rectangle_target().
  std::optional<Board> board = {};                  ///< Printed: visible from one side.
  std::vector<GreyPatch> patches = {};              ///< One per point.
  bool is_scale_given = true;                       ///< Whether `sigma_scale`, or the σ of the points, is known.
  double sigma_scale = 0.0;                         ///< σ of the target's size, relative, such as a print's.
  bool seen_from_plus_z = false;                    ///< Coplanar points are seen from +z; false: from −z.
};

/// A dark or bright rectangle. The map's frame is at its centre, x right, y down as first seen; corners 0 to 3 run
/// clockwise from (−, −). The default σ is that of a print on a flat surface.
[[nodiscard]] LocalizeTarget rectangle_target(double width_m, double height_m, double sigma_m = 0.0003);

ALIDADE_PUBLIC_END
}  // namespace alidade
