#include "alidade/localize/filter/feature.h"

#include <Eigen/LU>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double min_rho = 1e-4;  // 10 km: beyond it only the direction is observable

/// The point on a pixel's ray at a given distance. A flat port has no single centre: its ray is a first guess only.
struct PointOnRay {
  Eigen::Vector3d ray_in_cam;
  Eigen::Matrix<double, 3, 2> B;
  Eigen::Matrix2d J_px_turn;  ///< W.r.t. a rotation of the ray along B.
  LensProjection seen;
};

std::optional<PointOnRay> point_on_ray(const Camera& camera, const Eigen::Vector2d& px, double range_m) {
  const auto start = unproject(camera, px);
  if (!start) return std::nullopt;
  Eigen::Vector3d ray = *start;
  constexpr int max_iterations = 10;  // one is enough for a central camera
  for (int i = 0; i < max_iterations; ++i) {
    const auto seen = project_with_jacobians(camera, range_m * ray);
    if (!seen) return std::nullopt;
    const Eigen::Matrix<double, 3, 2> B = two_across(ray);
    const Eigen::Matrix2d A = seen->J_px_point * (range_m * B);
    const Eigen::Vector2d error = px - seen->px;
    if (!(std::abs(A.determinant()) > 0.0)) return std::nullopt;
    if (error.norm() < 1e-9) return PointOnRay{ray, B, A, *seen};
    ray = (ray + B * (A.inverse() * error)).normalized();
  }
  return std::nullopt;
}

}  // namespace

BearingAngles bearing_of(double theta, double phi) {
  const double ct = std::cos(theta), st = std::sin(theta), cp = std::cos(phi), sp = std::sin(phi);
  return {{cp * st, -sp, cp * ct}, {cp * ct, 0.0, -cp * st}, {-sp * st, -cp, -sp * ct}};
}

AnglesOfBearing angles_of(const Eigen::Vector3d& m) {
  const double h2 = m.x() * m.x() + m.z() * m.z(), h = std::sqrt(h2), n2 = h2 + m.y() * m.y();
  AnglesOfBearing out{std::atan2(m.x(), m.z()), std::atan2(-m.y(), h), {}};
  out.J << m.z() / h2, 0.0, -m.x() / h2, m.x() * m.y() / (h * n2), -h / n2, m.z() * m.y() / (h * n2);
  return out;
}

FeaturePlace place_of(const Feature& feature) {
  FeaturePlace place{feature.values.head<3>(), Eigen::Matrix<double, 3, 6>::Zero()};
  place.J.leftCols<3>().setIdentity();
  if (feature.kind == FeatureKind::xyz) return place;
  const BearingAngles bearing = bearing_of(feature.values[3], feature.values[4]);
  const double rho = std::max(feature.values[5], min_rho);
  place.point_in_world += bearing.m / rho;
  place.J.col(3) = bearing.m_theta / rho;
  place.J.col(4) = bearing.m_phi / rho;
  place.J.col(5) = -bearing.m / (rho * rho);
  return place;
}

std::optional<ExpectedView> expected_view(const Camera& camera, const Rigid3& world_from_cam, const Feature& feature) {
  const Eigen::Matrix3d cam_from_world_rotation = world_from_cam.rotation.toRotationMatrix().transpose();
  const bool is_inverse = feature.kind == FeatureKind::inverse_depth;
  const FeaturePlace place = place_of(feature);
  Eigen::Vector3d offset = place.point_in_world - world_from_cam.translation;
  Eigen::Matrix<double, 3, 6> J_offset = place.J;
  double J_position = -1.0;
  if (is_inverse && feature.values[5] < min_rho) {  // (c − r) ρ/ρ_min + m/ρ_min: the same direction, also for ρ ≤ 0
    const Eigen::Vector3d from_camera = feature.values.head<3>() - world_from_cam.translation;
    const double share = feature.values[5] / min_rho;
    offset += (share - 1.0) * from_camera;
    J_offset.leftCols<3>() *= share;
    J_offset.col(5) = from_camera / min_rho;
    J_position = -share;
  }
  const Eigen::Vector3d point_in_cam = cam_from_world_rotation * offset;
  const auto seen = project_with_jacobians(camera, point_in_cam);
  if (!seen) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> J_px_world = seen->J_px_point * cam_from_world_rotation;
  ExpectedView view;
  view.px = seen->px;
  view.J_px_pose.leftCols<3>() = J_position * J_px_world;
  view.J_px_pose.rightCols<3>() = seen->J_px_point * cross_matrix(point_in_cam);
  view.J_px_feature = J_px_world * J_offset;
  view.J_px_lens = seen->J_px_params;
  view.depth_m = point_in_cam.z();
  return view;
}

std::optional<NewFeature> new_feature(const Camera& camera, const Rigid3& world_from_cam, const Eigen::Vector2d& px,
                                      double sigma_px, const RangePrior& prior, FeatureKind kind) {
  const auto at = point_on_ray(camera, px, prior.range_m);
  if (!at) return std::nullopt;
  const Eigen::Matrix3d R = world_from_cam.rotation.toRotationMatrix();
  const Eigen::Matrix2d J_turn_px = at->J_px_turn.inverse();
  const Eigen::Matrix<double, 3, 2> J_ray_px = R * at->B * J_turn_px;
  // W.r.t. the distance; zero for a central camera, whose ray does not depend on it.
  const Eigen::Vector3d J_ray_range = -J_ray_px * (at->seen.J_px_point * at->ray_in_cam);
  const Eigen::Vector3d ray_in_world = R * at->ray_in_cam;
  const Eigen::Matrix3d J_ray_rotation = -R * cross_matrix(at->ray_in_cam);
  const double range = prior.range_m, variance_px2 = sigma_px * sigma_px;
  NewFeature made;
  made.feature.kind = kind;
  made.J_pose.setZero();
  made.J_pose.topLeftCorner<3, 3>().setIdentity();
  made.J_lens = Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 16>::Zero(6, at->seen.J_px_params.cols());
  if (kind == FeatureKind::xyz) {
    made.feature.values.head<3>() = world_from_cam.translation + range * ray_in_world;
    made.J_pose.topRightCorner<3, 3>() = range * J_ray_rotation;
    made.J_lens.topRows<3>() = -range * J_ray_px * at->seen.J_px_params;
    const Eigen::Matrix<double, 3, 2> L = range * sigma_px * J_ray_px;
    made.J_range.head<3>() = range * (ray_in_world + range * J_ray_range);
    const Eigen::Vector3d l = prior.sigma_rel * made.J_range.head<3>();
    made.cov.topLeftCorner<3, 3>() = L * L.transpose() + l * l.transpose();
    return made;
  }
  const AnglesOfBearing angles = angles_of(ray_in_world);
  made.feature.values << world_from_cam.translation, angles.theta, angles.phi, 1.0 / range;
  made.J_pose.block<2, 3>(3, 3) = angles.J * J_ray_rotation;
  made.J_lens.middleRows<2>(3) = -angles.J * J_ray_px * at->seen.J_px_params;
  made.J_range.tail<3>() << angles.J * J_ray_range * range, -1.0 / range;
  const Eigen::Vector3d l = prior.sigma_rel * made.J_range.tail<3>();
  const Eigen::Matrix2d J = angles.J * J_ray_px;
  made.cov.bottomRightCorner<3, 3>() = l * l.transpose();
  made.cov.block<2, 2>(3, 3) += variance_px2 * J * J.transpose();
  return made;
}

double linearity_index(const Feature& feature, double sigma_rho, const Eigen::Vector3d& camera_in_world) {
  const double rho = feature.values[5];
  if (!(rho > min_rho)) return 1e9;
  const Eigen::Vector3d ray_in_world = bearing_of(feature.values[3], feature.values[4]).m;
  const Eigen::Vector3d from_here = feature.values.head<3>() + ray_in_world / rho - camera_in_world;
  const double distance = from_here.norm(), sigma_d = sigma_rho / (rho * rho);
  return 4.0 * sigma_d / distance * std::abs(ray_in_world.dot(from_here) / distance);
}

}  // namespace alidade
