#include "alidade/rangefinder/checks/shot_residual.h"

#include <Eigen/Cholesky>
#include <Eigen/Geometry>
#include <cmath>

#include "alidade/beam/unit_direction.h"

namespace alidade {
namespace {

/// Where the beam meets a plane, as a distance from its origin, with the derivatives of that distance.
struct Hit {
  double distance_m = 0.0;
  Eigen::Matrix<double, 1, num_beam_params> J_beam;
  Eigen::Matrix<double, 1, 6> J_pose;
  Eigen::Matrix<double, 1, 4> J_plane;
};

std::optional<Hit> hit_of(const PreparedShot& shot, const Beam& beam) {
  const Eigen::Vector3d& n = shot.plane->normal_in_cam;
  const double cosine = n.dot(beam.direction_in_cam);
  Hit hit;
  hit.distance_m = -(shot.plane->d_m + n.dot(beam.origin_in_cam)) / cosine;
  // A beam that grazes the board to a thousandth, or meets it behind its origin, measures no board.
  if (!(std::abs(cosine) > 1e-3 && hit.distance_m > 0.0 && std::isfinite(hit.distance_m))) return std::nullopt;
  const Eigen::RowVector3d by_origin = -n.transpose() / cosine;
  hit.J_beam << by_origin, hit.distance_m * by_origin * tangent_basis(beam.direction_in_cam), 0.0;
  const Eigen::Vector3d point_in_cam = beam.origin_in_cam + hit.distance_m * beam.direction_in_cam;
  hit.J_plane << -point_in_cam.transpose() / cosine, -1.0 / cosine;
  hit.J_pose.setZero();
  if (shot.pose) {
    // The plane may be rotated to face away from the camera; hit and derivatives are those of the board's own normal.
    const Eigen::Quaterniond& rotation = shot.pose->cam_from_board.rotation;
    const Eigen::Vector3d z(0.0, 0.0, 1.0);
    const double board_cosine = (rotation * z).dot(beam.direction_in_cam);
    const Eigen::Vector3d back_in_board = rotation.conjugate() * (shot.pose->cam_from_board.translation - point_in_cam);
    hit.J_pose << z.transpose() / board_cosine, z.cross(back_in_board).transpose() / board_cosine;
  }
  return hit;
}

double tangent_of_incidence(const PreparedShot& shot, const Beam& beam) {
  const double cosine = std::abs(shot.plane->normal_in_cam.dot(beam.direction_in_cam));
  return std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) / cosine;
}

double sigma_of_reading(const PreparedShot& shot, const Beam& beam, const ShotModel& model) {
  if (shot.sigma_range_m) return *shot.sigma_range_m;
  const bool has_angle = shot.plane && model.noise.incidence_m > 0.0;
  return model.noise.sigma_at(shot.range_m, has_angle ? tangent_of_incidence(shot, beam) : 0.0);
}

void put_range_row(const PreparedShot& shot, const Hit& hit, const Beam& beam, double sigma_m, ShotResidual& out) {
  out.r[0] = hit.distance_m / beam.scale - shot.range_m;
  out.J_beam.row(0) = hit.J_beam / beam.scale;
  out.J_beam(0, 5) = -hit.distance_m / (beam.scale * beam.scale);
  out.J_pose.row(0) = hit.J_pose / beam.scale;
  out.J_plane.row(0) = hit.J_plane / beam.scale;
  out.J_errors(0, 0) = -1.0;
  out.noise_cov(0, 0) = sigma_m * sigma_m;
}

/// `hit`: predict there; none: predict at the reading.
bool put_spot_rows(const PreparedShot& shot, const Hit* hit, const Beam& beam, const Camera& camera, double sigma_m,
                   ShotResidual& out) {
  const double distance_m = hit ? hit->distance_m : beam.scale * shot.range_m;
  const auto seen = project_with_jacobians(camera, beam.origin_in_cam + distance_m * beam.direction_in_cam);
  if (!seen) return false;
  const Eigen::Index row = out.r.size() - 2;
  const Eigen::Vector2d along = seen->J_px_point * beam.direction_in_cam;  // pixels for each metre along the beam
  out.r.segment<2>(row) = seen->px - *shot.spot_px;
  Eigen::Matrix<double, 2, num_beam_params> J;
  J << seen->J_px_point, distance_m * seen->J_px_point * tangent_basis(beam.direction_in_cam), Eigen::Vector2d::Zero();
  if (hit) {
    J += along * hit->J_beam;
    out.J_pose.middleRows<2>(row) = along * hit->J_pose;
    out.J_plane.middleRows<2>(row) = along * hit->J_plane;
  } else {
    J.col(5) = along * shot.range_m;
  }
  out.J_beam.middleRows<2>(row) = J;
  out.J_lens.middleRows(row, 2) = seen->J_px_params;
  out.J_errors.block<2, 2>(row, 1).diagonal().setConstant(-1.0);
  if (!hit) out.J_errors.block<2, 1>(row, 0) = beam.scale * along;
  out.noise_cov.block<2, 2>(row, row).diagonal().setConstant(shot.sigma_spot_px * shot.sigma_spot_px);
  if (!hit) {
    const double moved_m = beam.scale * sigma_m;
    out.noise_cov.block<2, 2>(row, row) += moved_m * moved_m * along * along.transpose();
  }
  return true;
}

}  // namespace

std::optional<ShotResidual> shot_residual(const PreparedShot& shot, const Beam& beam, const Camera& camera,
                                          const ShotModel& model) {
  const int rows = shot.num_rows();
  const Eigen::Index num_lens = std::visit([](const auto& lens) { return lens.params.size(); }, camera.lens);
  std::optional<ShotResidual> result(std::in_place);  // built where it is returned: it is large
  ShotResidual& out = *result;
  out.r.setZero(rows);
  out.J_beam.setZero(rows, num_beam_params);
  out.J_pose.setZero(rows, 6);
  out.J_plane.setZero(rows, 4);
  out.J_lens.setZero(rows, num_lens);
  out.J_errors.setZero(rows, 3);
  out.noise_cov.setZero(rows, rows);
  const double sigma_m = sigma_of_reading(shot, beam, model);
  std::optional<Hit> hit;
  if (shot.plane) {
    hit = hit_of(shot, beam);
    if (!hit) return std::nullopt;
    put_range_row(shot, *hit, beam, sigma_m, out);
  }
  const Hit* at = hit && !model.reading_counts_twice ? &*hit : nullptr;
  if (shot.spot_px && !put_spot_rows(shot, at, beam, camera, sigma_m, out)) return std::nullopt;
  if (!out.r.allFinite()) return std::nullopt;
  return result;
}

Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> full_covariance(const PreparedShot& shot,
                                                                               const ShotResidual& residual) {
  if (shot.pose) return residual.noise_cov + residual.J_pose * shot.pose->cov * residual.J_pose.transpose();
  if (!shot.plane) return residual.noise_cov;
  return residual.noise_cov + residual.J_plane * shot.plane->cov * residual.J_plane.transpose();
}

Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3> whitener_of(
    const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>& cov) {
  using Square = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;
  const Eigen::LLT<Square> llt(cov);
  return llt.matrixL().solve(Square::Identity(cov.rows(), cov.cols()));
}

}  // namespace alidade
