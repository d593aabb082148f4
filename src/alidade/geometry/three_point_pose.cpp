#include "alidade/geometry/three_point_pose.h"

#include <Eigen/Dense>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// Real roots of c₄ x⁴ + … + c₀, as eigenvalues of its companion matrix.
std::vector<double> real_roots(const std::array<double, 5>& c) {
  double largest = 0.0;
  for (const double each : c) largest = std::max(largest, std::abs(each));
  constexpr double none = 1e-12;
  if (!(std::abs(c[4]) > none * largest)) return {};
  Eigen::Matrix4d companion = Eigen::Matrix4d::Zero();
  companion.diagonal(-1).setOnes();
  for (int i = 0; i < 4; ++i) companion(i, 3) = -c[static_cast<std::size_t>(i)] / c[4];
  if (!companion.allFinite()) return {};
  std::vector<double> roots;
  constexpr double nearly_real = 1e-4;  // of a double root; noise parts them by its square root
  for (const std::complex<double>& root : eigenvalues_of(companion))
    if (std::abs(root.imag()) < nearly_real * (1.0 + std::abs(root.real()))) roots.push_back(root.real());
  return roots;
}

/// Distances along the rays, by Newton on the three sides: roots that lie together are poor ones. False where they do
/// not meet.
bool polished(const std::array<Eigen::Vector3d, 3>& ray, const Eigen::Vector3d& sides2, Eigen::Vector3d& along) {
  constexpr int max_steps = 10;
  constexpr double met = 1e-10;
  constexpr std::array<std::array<int, 2>, 3> ends{{{1, 2}, {0, 2}, {0, 1}}};
  for (int step = 0; step < max_steps; ++step) {
    Eigen::Vector3d off;
    Eigen::Matrix3d J = Eigen::Matrix3d::Zero();
    for (int side = 0; side < 3; ++side) {
      const auto [i, j] = ends[static_cast<std::size_t>(side)];
      const Eigen::Vector3d &ray_i = ray[static_cast<std::size_t>(i)], &ray_j = ray[static_cast<std::size_t>(j)];
      const Eigen::Vector3d apart = along[i] * ray_i - along[j] * ray_j;
      off[side] = apart.squaredNorm() - sides2[side];
      J(side, i) = 2.0 * apart.dot(ray_i);
      J(side, j) = -2.0 * apart.dot(ray_j);
    }
    if (off.cwiseAbs().maxCoeff() < met * sides2.maxCoeff()) return along.minCoeff() > 0.0;
    along -= J.partialPivLu().solve(off);
    if (!along.allFinite()) return false;
  }
  return false;
}

/// The motion that takes three points to three others.
Rigid3 motion_between(const std::array<Eigen::Vector3d, 3>& from, const std::array<Eigen::Vector3d, 3>& to) {
  const auto axes = [](const std::array<Eigen::Vector3d, 3>& p) {
    Eigen::Matrix3d R;
    R.col(0) = (p[1] - p[0]).normalized();
    R.col(2) = R.col(0).cross(p[2] - p[0]).normalized();
    R.col(1) = R.col(2).cross(R.col(0));
    return R;
  };
  Rigid3 to_from;
  to_from.rotation = Eigen::Quaterniond(axes(to) * axes(from).transpose()).normalized();
  const Eigen::Vector3d centre_from = (from[0] + from[1] + from[2]) / 3.0, centre_to = (to[0] + to[1] + to[2]) / 3.0;
  to_from.translation = centre_to - to_from.rotation * centre_from;
  return to_from;
}

}  // namespace

std::vector<Rigid3> three_point_poses(const std::array<Eigen::Vector3d, 3>& p,
                                      const std::array<Eigen::Vector3d, 3>& rays_in_cam) {
  std::array<Eigen::Vector3d, 3> ray;
  for (std::size_t i = 0; i < 3; ++i) ray[i] = rays_in_cam[i].normalized();
  const double a2 = (p[1] - p[2]).squaredNorm(), b2 = (p[0] - p[2]).squaredNorm(), c2 = (p[0] - p[1]).squaredNorm();
  constexpr double thin = 1e-9;  // squares of areas over sides
  const double area2 = (p[1] - p[0]).cross(p[2] - p[0]).squaredNorm();
  if (!(area2 > thin * std::max({a2, b2, c2}) * std::max({a2, b2, c2}))) return {};
  const double cos_a = ray[1].dot(ray[2]), cos_b = ray[0].dot(ray[2]), cos_c = ray[0].dot(ray[1]);
  const double m = (a2 - c2) / b2, s = (a2 + c2) / b2, a = a2 / b2, c = c2 / b2;
  const std::vector<double> roots =
      real_roots({(1.0 + m) * (1.0 + m) - 4.0 * a * cos_c * cos_c,
                  4.0 * (-m * (1.0 + m) * cos_b + 2.0 * a * cos_c * cos_c * cos_b - (1.0 - s) * cos_a * cos_c),
                  2.0 * (m * m - 1.0 + 2.0 * m * m * cos_b * cos_b + 2.0 * (1.0 - c) * cos_a * cos_a -
                         4.0 * s * cos_a * cos_b * cos_c + 2.0 * (1.0 - a) * cos_c * cos_c),
                  4.0 * (m * (1.0 - m) * cos_b - (1.0 - s) * cos_a * cos_c + 2.0 * c * cos_a * cos_a * cos_b),
                  (m - 1.0) * (m - 1.0) - 4.0 * c * cos_a * cos_a});
  std::vector<Rigid3> poses;
  for (const double v : roots) {
    const double below = 2.0 * (cos_c - v * cos_a);
    const double u = ((m - 1.0) * v * v - 2.0 * m * cos_b * v + 1.0 + m) / below;
    const double s1 = std::sqrt(b2 / (1.0 + v * v - 2.0 * v * cos_b));
    if (!(v > 0.0) || !(u > 0.0) || !std::isfinite(u) || !std::isfinite(s1)) continue;
    Eigen::Vector3d along = s1 * Eigen::Vector3d(1.0, u, v);
    if (!polished(ray, {a2, b2, c2}, along)) continue;
    poses.push_back(motion_between({along[0] * ray[0], along[1] * ray[1], along[2] * ray[2]}, p));
  }
  return poses;
}

}  // namespace alidade
