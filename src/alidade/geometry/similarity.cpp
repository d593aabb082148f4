#include "alidade/geometry/similarity.h"

#include <Eigen/SVD>

#include "alidade/geometry/decompositions.h"

namespace alidade {

std::optional<Similarity> aligned(std::span<const Eigen::Vector3d> a, std::span<const Eigen::Vector3d> b,
                                  bool is_rigid) {
  if (a.size() != b.size() || a.size() < 3) return std::nullopt;
  const auto num = static_cast<double>(a.size());
  Eigen::Vector3d mean_a = Eigen::Vector3d::Zero(), mean_b = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < a.size(); ++i) {
    mean_a += a[i] / num;
    mean_b += b[i] / num;
  }
  Eigen::Matrix3d cross = Eigen::Matrix3d::Zero();
  double variance_a = 0.0;
  for (std::size_t i = 0; i < a.size(); ++i) {
    cross += (b[i] - mean_b) * (a[i] - mean_a).transpose() / num;
    variance_a += (a[i] - mean_a).squaredNorm() / num;
  }
  const Svd svd = svd_of(cross);
  const Eigen::Vector3d D = svd.values;
  if (!(D[1] > 1e-12 * D[0]) || !(variance_a > 0.0)) return std::nullopt;
  const double mirror = Eigen::Matrix3d(svd.U).determinant() * Eigen::Matrix3d(svd.V).determinant() < 0.0 ? -1.0 : 1.0;
  const Eigen::Vector3d sign(1.0, 1.0, mirror);
  const Eigen::Matrix3d R = svd.U * sign.asDiagonal() * svd.V.transpose();
  Similarity result;
  result.scale = is_rigid ? 1.0 : D.dot(sign) / variance_a;
  result.b_from_a = {Eigen::Quaterniond(R), mean_b - result.scale * (R * mean_a)};
  return result;
}

}  // namespace alidade
