#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace alidade {

/// Homography H with `to` ~ H (`from`, 1), by the normalised direct linear transform; |H| = 1, H₃₃ ≥ 0.
/// None for fewer than four points or if all are collinear. At most `max_points` evenly chosen points are used.
/// Hartley & Zisserman, "Multiple View Geometry", 2003, algorithm 4.2.
[[nodiscard]] std::optional<Eigen::Matrix3d> fit_homography(std::span<const Eigen::Vector2d> from,
                                                            std::span<const Eigen::Vector2d> to,
                                                            std::size_t max_points = 96);

}  // namespace alidade
