#pragma once

#include <optional>
#include <span>

#include "alidade/geometry/rigid3.h"

namespace alidade {

/// b = scale · R a + t.
struct Similarity {
  Rigid3 b_from_a;  ///< R and t.
  double scale = 1.0;
};

/// The similarity (or with `is_rigid` the motion, scale 1) that takes points a to points b with least squares.
/// None for fewer than three points, or all on a line. S. Umeyama, "Least-Squares Estimation of Transformation
/// Parameters Between Two Point Patterns", PAMI 13(4), 1991.
[[nodiscard]] std::optional<Similarity> aligned(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                                                bool is_rigid);

}  // namespace alidade
