#include "alidade/fleet/fleet_learning.h"

#include <Eigen/Cholesky>
#include <cmath>
#include <vector>

#include "alidade/fleet/fleet_reading.h"

namespace alidade {
namespace {

constexpr double largest_sigma_px = 5.0;  // of pixels of static points
constexpr double fine_enough = 0.05;      // σ of the focal length, relative: from there on the filter is linear enough
constexpr int max_steps = 25;

struct KeptRow {
  FleetRotation rotation;
  std::array<Eigen::Vector2d, max_fleet_points> px;
};

std::vector<KeptRow> kept_rows(const FleetCamera& camera) {
  std::vector<KeptRow> rows(camera.num_buffered);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const auto& from = camera.body.learning.rows[i];
    rows[i].rotation = kept_rotation(camera.source, from.data());
    for (std::size_t k = 0; k < max_fleet_points; ++k) rows[i].px[k] = {from[4 + 2 * k], from[5 + 2 * k]};
  }
  return rows;
}

/// Intrinsics and directions, adjusted together.
struct Fit {
  bool is_good = false;
  FleetCommon x = FleetCommon::Zero();
  Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();
  std::array<Eigen::Vector3d, max_fleet_points> direction;
  std::array<Eigen::Matrix2d, max_fleet_points> D;              ///< Information of each point, of σ = 1.
  std::array<Eigen::Matrix<double, 2, 4>, max_fleet_points> B;  ///< With the intrinsics.
  std::array<int, max_fleet_points> num_seen{};
  double squares = 0.0, sigma_px = 0.0;
};

bool is_seen(const Eigen::Vector2d& px) { return std::isfinite(px.x()) && std::isfinite(px.y()); }

/// Normal equations of the intrinsics, the points eliminated.
struct Reduced {
  Eigen::Matrix4d S = Eigen::Matrix4d::Zero();
  Eigen::Vector4d gradient = Eigen::Vector4d::Zero();
  std::array<Eigen::Vector2d, max_fleet_points> g{};  ///< Gradient of each point.
  double gain = 0.0;                                  ///< In squares, of the points alone.
};

/// Adds what the rows say of point k, and eliminates it; false where it cannot be.
bool add_point(const std::vector<KeptRow>& rows, std::size_t k, Fit& fit, Reduced& reduced) {
  const auto basis = basis_beside(fit.direction[k]);
  Eigen::Vector4d own = Eigen::Vector4d::Zero();
  for (const KeptRow& row : rows) {
    if (!is_seen(row.px[k])) continue;
    const FleetPrediction at = FleetView(row.rotation, fit.x).predict(fit.direction[k]);
    if (!at.is_seen) return false;
    const Eigen::Vector2d residual = row.px[k] - at.px;
    const Eigen::Matrix2d J = at.by_ray * basis;
    const Eigen::Matrix<double, 2, 4> J_k = at.by_common.leftCols<4>();
    fit.D[k] += J.transpose() * J;
    fit.B[k] += J.transpose() * J_k;
    reduced.g[k] += J.transpose() * residual;
    reduced.S += J_k.transpose() * J_k;
    own += J_k.transpose() * residual;
    fit.squares += residual.squaredNorm();
  }
  if (!(fit.D[k].determinant() > 0.0)) return false;
  const Eigen::Matrix2d inverse = fit.D[k].inverse();
  reduced.S -= fit.B[k].transpose() * inverse * fit.B[k];
  reduced.gradient += own - fit.B[k].transpose() * (inverse * reduced.g[k]);
  reduced.gain += reduced.g[k].dot(inverse * reduced.g[k]);
  return true;
}

/// One Gauss–Newton step; the gain in squares, or a negative number where it is none.
double take_step(const std::vector<KeptRow>& rows, int num_points, Fit& fit) {
  Reduced reduced;
  fit.squares = 0.0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(num_points); ++k) {
    fit.D[k].setZero();
    fit.B[k].setZero();
    reduced.g[k].setZero();
    if (fit.num_seen[k] >= 3 && !add_point(rows, k, fit, reduced)) return -1.0;
  }
  const Eigen::LLT<Eigen::Matrix4d> llt(reduced.S);
  if (llt.info() != Eigen::Success) return -1.0;
  const Eigen::Vector4d move = llt.solve(reduced.gradient);
  const double gain = reduced.gain + move.dot(reduced.gradient);
  fit.x.head<4>() += move;
  fit.cov = llt.solve(Eigen::Matrix4d::Identity());
  for (std::size_t k = 0; k < static_cast<std::size_t>(num_points); ++k) {
    if (fit.num_seen[k] < 3) continue;
    const Eigen::Vector2d by = fit.D[k].inverse() * (reduced.g[k] - fit.B[k] * move);
    fit.direction[k] = (fit.direction[k] + basis_beside(fit.direction[k]) * by).normalized();
  }
  const bool is_possible = fit.x[0] > 1.0 && fit.x[1] > 1.0 && std::isfinite(gain);
  return is_possible ? gain : -1.0;
}

Fit fit_from(const std::vector<KeptRow>& rows, int num_points, const FleetCommon& start) {
  Fit fit;
  fit.x = start;
  int num_pixels = 0, num_used = 0;
  for (std::size_t k = 0; k < static_cast<std::size_t>(num_points); ++k) {
    for (const KeptRow& row : rows) {
      if (!is_seen(row.px[k])) continue;
      if (fit.num_seen[k]++ == 0) fit.direction[k] = FleetView(row.rotation, fit.x).ray_of(row.px[k]);
    }
    if (fit.num_seen[k] < 3) continue;
    num_pixels += fit.num_seen[k];
    ++num_used;
  }
  const double dof = 2.0 * num_pixels - 4.0 - 2.0 * num_used;
  if (num_used < 1 || !(dof > 4.0)) return fit;
  for (int i = 0; i < max_steps; ++i) {
    const double gain = take_step(rows, num_points, fit);
    if (gain < 0.0) return fit;
    if (!(gain * dof < 1e-5 * fit.squares)) continue;
    fit.sigma_px = std::max(std::sqrt(fit.squares / dof), 1e-3);
    fit.cov *= fit.sigma_px * fit.sigma_px;
    fit.is_good = fit.sigma_px < largest_sigma_px && std::sqrt(fit.cov(0, 0)) < fine_enough * fit.x[0] &&
                  std::sqrt(fit.cov(1, 1)) < fine_enough * fit.x[1];
    return fit;
  }
  return fit;
}

Fit best_fit(const FleetCamera& camera, const FleetConfig& config) {
  const std::vector<KeptRow> rows = kept_rows(camera);
  Fit best;
  for (const double times : {1.0, 2.0, 0.6, 4.0}) {
    FleetCommon start = FleetCommon::Zero();
    start.head<4>() << times * config.width_px, times * config.width_px, 0.5 * (config.width_px - 1.0),
        0.5 * (config.height_px - 1.0);
    const Fit fit = fit_from(rows, camera.num_points, start);
    if (fit.is_good && (!best.is_good || fit.squares < best.squares)) best = fit;
  }
  return best;
}

void begin_tracking(const Fit& fit, FleetCamera& camera) {
  FleetTracking tracking;
  const double variance = fit.sigma_px * fit.sigma_px;
  for (std::size_t i = 0; i < num_fleet_common; ++i) tracking.x[i] = fit.x[static_cast<Eigen::Index>(i)];
  std::size_t at = 0;
  for (Eigen::Index i = 0; i < num_fleet_common; ++i)
    for (Eigen::Index j = i; j < num_fleet_common; ++j) tracking.P[at++] = i < 4 && j < 4 ? fit.cov(i, j) : 0.0;
  camera.known_points = 0;
  for (std::size_t k = 0; k < camera.num_points; ++k) {
    if (fit.num_seen[k] < 3) continue;
    camera.known_points = static_cast<std::uint8_t>(camera.known_points | (1U << k));
    FleetPoint& point = tracking.points[k];
    const Eigen::Matrix2d inverse = fit.D[k].inverse();
    const Eigen::Matrix<double, 2, 4> slope = -inverse * fit.B[k];
    for (Eigen::Index i = 0; i < 3; ++i) point.direction[static_cast<std::size_t>(i)] = fit.direction[k][i];
    for (Eigen::Index i = 0; i < 2; ++i)
      for (Eigen::Index j = 0; j < 4; ++j)
        point.slope[static_cast<std::size_t>(i * num_fleet_common + j)] = slope(i, j);
    point.cov = {variance * inverse(0, 0), variance * inverse(0, 1), variance * inverse(1, 1)};
  }
  camera.sigma_px = fit.sigma_px;
  camera.sum_nis = camera.sum_dof = 0.0;
  camera.num_gated = 0;
  camera.phase = FleetPhase::tracking;
  camera.misread = 0;
  camera.body.tracking = tracking;
}

}  // namespace

void learn(FleetCamera& camera, const FleetRow& row, const FleetRotation& rotation, const FleetConfig& config) {
  if (++camera.since_kept < camera.stride) return;
  camera.since_kept = 0;
  // With the roll in one: the zeros are zero while a camera is initialised.
  const Eigen::Quaterniond q(Eigen::Matrix3d(rotation.before * rotation.after));
  auto& kept = camera.body.learning.rows[camera.num_buffered++];
  kept = {static_cast<float>(q.w()), static_cast<float>(q.x()), static_cast<float>(q.y()), static_cast<float>(q.z())};
  if (row.source == FleetSource::head)
    for (std::size_t i = 0; i < 4; ++i) kept[i] = static_cast<float>(row.rotation[i]);
  for (std::size_t i = 0; i < 2 * max_fleet_points; ++i)
    kept[4 + i] = i < 2 * static_cast<std::size_t>(camera.num_points) ? static_cast<float>(row.px[i]) : NAN;
  if (camera.num_buffered < fleet_learning_rows) return;
  const Fit fit = best_fit(camera, config);
  if (fit.is_good) return begin_tracking(fit, camera);
  seek_misreading(camera, config);
  for (std::size_t i = 0; 2 * i < fleet_learning_rows; ++i)
    camera.body.learning.rows[i] = camera.body.learning.rows[2 * i];
  camera.num_buffered = fleet_learning_rows / 2;
  camera.stride = std::min<std::uint32_t>(2 * camera.stride, 1U << 20U);
}

}  // namespace alidade
