#include "alidade/rangefinder/solve/beam_start.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/beam/unit_direction.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Rows6 = Eigen::Matrix<double, Eigen::Dynamic, 6>;

/// Two rows whose product with a point is zero where the point is on the ray: x z' − x' z and y z' − y' z, as the paper
/// has them; for rays far off the axis two tangents.
Eigen::Matrix<double, 2, 3> across(const Eigen::Vector3d& ray) {
  if (!(ray.z() > 0.2)) return tangent_basis(ray).transpose();
  return (Eigen::Matrix<double, 2, 3>() << 1.0, 0.0, -ray.x() / ray.z(), 0.0, 1.0, -ray.y() / ray.z()).finished();
}

std::optional<Beam> beam_of(const Eigen::Vector3d& A, const Eigen::Vector3d& B) {
  Beam beam;
  beam.direction_in_cam = A.normalized();
  beam.origin_in_cam = B;
  if (!beam.direction_in_cam.allFinite() || !B.allFinite()) return std::nullopt;
  return beam;
}

/// What the constraint |A| = 1 leaves of min |C A − e|: A(λ) = Σ f_i / (s_i² + λ) v_i.
struct UnitNormProblem {
  Eigen::Vector3d s2, f;
  Eigen::Matrix3d V;

  [[nodiscard]] Eigen::Vector3d at(double lambda) const { return V * (f.array() / (s2.array() + lambda)).matrix(); }
};

using Polynomial = std::array<double, 7>;  // coefficients, lowest first

Polynomial times(const Polynomial& a, const Polynomial& b) {
  Polynomial product{};
  for (std::size_t i = 0; i < 7; ++i)
    for (std::size_t j = 0; i + j < 7; ++j) product[i + j] += a[i] * b[j];
  return product;
}

/// Real roots of Π(s_i²+λ)² − Σ f_i² Π_{j≠i}(s_j²+λ)² = 0, the condition |A(λ)| = 1.
std::vector<double> multipliers(const UnitNormProblem& problem) {
  std::array<Polynomial, 3> squares;
  for (std::size_t i = 0; i < 3; ++i) {
    const double s2 = problem.s2[static_cast<Eigen::Index>(i)];
    squares[i] = {s2 * s2, 2.0 * s2, 1.0, 0.0, 0.0, 0.0, 0.0};
  }
  Polynomial sextic = times(times(squares[0], squares[1]), squares[2]);
  for (std::size_t i = 0; i < 3; ++i) {
    const Polynomial others = times(squares[(i + 1) % 3], squares[(i + 2) % 3]);
    const double f = problem.f[static_cast<Eigen::Index>(i)];
    for (std::size_t k = 0; k < 7; ++k) sextic[k] -= f * f * others[k];
  }
  Eigen::Matrix<double, 6, 6> companion = Eigen::Matrix<double, 6, 6>::Zero();
  for (int k = 0; k < 6; ++k) companion(k, 5) = -sextic[static_cast<std::size_t>(k)];
  companion.diagonal<-1>().setOnes();
  if (!companion.allFinite()) return {};
  std::vector<double> roots;
  for (const std::complex<double>& root : eigenvalues_of(companion)) {
    // A double root comes out as a pair that is complex by the root of the rounding.
    if (std::abs(root.imag()) < 1e-5 * (1e-3 + std::abs(root))) roots.push_back(root.real());
  }
  return roots;
}

/// Directions of unit length that are stationary: by the multipliers, or, where the least singular value is zero (five
/// planes), the line A₀ + μ v₃ cut with the sphere.
std::vector<Eigen::Vector3d> unit_directions(const UnitNormProblem& problem) {
  std::vector<Eigen::Vector3d> directions;
  if (problem.s2[2] < 1e-20 * problem.s2[0]) {
    Eigen::Vector3d on_line = Eigen::Vector3d::Zero();
    for (int i = 0; i < 2; ++i) on_line += problem.f[i] / problem.s2[i] * problem.V.col(i);
    const double rest = std::sqrt(std::max(0.0, 1.0 - on_line.squaredNorm()));
    for (const double side : {1.0, -1.0}) directions.push_back((on_line + side * rest * problem.V.col(2)).normalized());
    return directions;
  }
  for (const double lambda : multipliers(problem)) {
    const Eigen::Vector3d A = problem.at(lambda);
    if (A.allFinite() && A.norm() > 0.1) directions.push_back(A.normalized());
  }
  return directions;
}

bool is_in_front(const Beam& beam, std::span<const PreparedShot* const> shots) {
  return std::all_of(shots.begin(), shots.end(),
                     [&](const PreparedShot* shot) { return point_at(beam, shot->range_m).z() > 0.0; });
}

}  // namespace

std::optional<Beam> spot_start(std::span<const PreparedShot* const> shots) {
  if (shots.size() < 3) return std::nullopt;
  double mean_range_m = 0.0;
  for (const PreparedShot* shot : shots) mean_range_m += shot->range_m / static_cast<double>(shots.size());
  Rows6 M(2 * static_cast<Eigen::Index>(shots.size()), 6);
  for (Eigen::Index i = 0; i < M.rows() / 2; ++i) {
    const PreparedShot& shot = *shots[static_cast<std::size_t>(i)];
    const Eigen::Matrix<double, 2, 3> rows = across(*shot.spot_ray);
    M.middleRows<2>(2 * i) << shot.range_m / mean_range_m * rows, rows;
  }
  const Eigen::Matrix<double, 6, 1> size = M.colwise().norm().transpose();
  if (!(size.minCoeff() > 0.0) || !M.allFinite()) return std::nullopt;
  const Svd svd = svd_of(M * size.cwiseInverse().asDiagonal());
  Eigen::Matrix<double, 6, 1> null = svd.V.col(5).cwiseQuotient(size);
  null.head<3>() /= mean_range_m;
  null /= null.head<3>().norm();
  double ahead = 0.0;  // the spots are in front of the camera
  for (const PreparedShot* shot : shots)
    ahead += shot->spot_ray->dot(shot->range_m * null.head<3>() + null.tail<3>()) > 0.0 ? 1.0 : -1.0;
  if (ahead < 0.0) null = -null;
  return beam_of(null.head<3>(), null.tail<3>());
}

std::vector<Beam> plane_starts(std::span<const PreparedShot* const> shots) {
  const auto n = static_cast<Eigen::Index>(shots.size());
  if (n < 5) return {};
  Eigen::Matrix<double, Eigen::Dynamic, 3> N(n, 3), LN(n, 3);
  Eigen::VectorXd d(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const PreparedShot& shot = *shots[static_cast<std::size_t>(i)];
    N.row(i) = shot.plane->normal_in_cam.transpose();
    LN.row(i) = shot.range_m * N.row(i);
    d[i] = shot.plane->d_m;
  }
  if (!LN.allFinite() || !d.allFinite()) return {};
  const Eigen::MatrixXd Q = orthonormal_basis(N, n);
  const Eigen::MatrixXd C = Q.rightCols(n - 3).transpose() * LN;  // what the origin cannot take up
  const Eigen::VectorXd e = -Q.rightCols(n - 3).transpose() * d;
  const Svd svd = svd_of(C);
  UnitNormProblem problem{Eigen::Vector3d::Zero(), Eigen::Vector3d::Zero(), svd.V};
  const Eigen::Index rank = svd.values.size();
  problem.s2.head(rank) = svd.values.array().square();
  problem.f.head(rank) = svd.values.asDiagonal() * (svd.U.transpose() * e);
  std::vector<std::pair<double, Beam>> found;
  for (const Eigen::Vector3d& A : unit_directions(problem)) {
    const Eigen::VectorXd rest = -(d + LN * A);
    const auto beam = beam_of(A, least_squares(N, rest));
    if (!beam || !is_in_front(*beam, shots)) continue;
    found.emplace_back((N * beam->origin_in_cam - rest).squaredNorm(), *beam);
  }
  std::stable_sort(found.begin(), found.end(), [](const auto& a, const auto& b) { return a.first < b.first; });
  std::vector<Beam> beams;
  for (const auto& [cost, beam] : found) beams.push_back(beam);
  return beams;
}

std::optional<Beam> joint_start(std::span<const PreparedShot* const> shots, const ShotModel& model, double focal_px,
                                bool estimate_scale) {
  std::vector<Eigen::Matrix<double, 1, 7>> rows;
  bool knows_size = false;
  for (const PreparedShot* shot : shots) {
    const double L = shot->range_m, sigma_m = shot->sigma_range_m.value_or(model.noise.sigma_at(L));
    if (shot->plane) {
      knows_size = true;
      const Eigen::RowVector3d n = shot->plane->normal_in_cam.transpose() / sigma_m;
      rows.emplace_back() << L * n, n, -shot->plane->d_m / sigma_m;
    }
    if (!shot->spot_px) continue;
    const Eigen::Matrix<double, 2, 3> ray = across(*shot->spot_ray) * focal_px / (L * shot->sigma_spot_px);
    for (int i = 0; i < 2; ++i) rows.emplace_back() << L * ray.row(i), ray.row(i), 0.0;
  }
  if (!knows_size || rows.size() < 6) return std::nullopt;
  Eigen::Matrix<double, Eigen::Dynamic, 7> M(static_cast<Eigen::Index>(rows.size()), 7);
  for (std::size_t i = 0; i < rows.size(); ++i) M.row(static_cast<Eigen::Index>(i)) = rows[i];
  if (!M.allFinite()) return std::nullopt;
  const Eigen::Matrix<double, 6, 1> solved = least_squares(M.leftCols<6>(), M.col(6));
  auto beam = beam_of(solved.head<3>(), solved.tail<3>());
  if (beam && estimate_scale) beam->scale = solved.head<3>().norm();
  return beam;
}

}  // namespace alidade
