#pragma once

#include <Eigen/Geometry>
#include <vector>

namespace alidade {

/// A vector, and a quaternion (w, x, y, z), as stored in a JSON file.
[[nodiscard]] inline std::vector<double> list_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
[[nodiscard]] inline std::vector<double> list_of(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

}  // namespace alidade
