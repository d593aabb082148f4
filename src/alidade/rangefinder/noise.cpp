#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/solve/beam_search.h"

namespace alidade {
namespace {

/// One kind of measurement: its squared residuals, each in units of its σ², and what the beam takes up of them.
struct Group {
  double sum = 0.0;
  double num = 0.0;
  BeamMatrix H = BeamMatrix::Zero();
};

/// Adds rows whose covariance is `own` (the kind's noise) + `carried` (the plane's, the reading's): a residual r counts
/// for the noise by the share of it that is the noise's.
template <int rows>
void add(Group& group, const Eigen::Matrix<double, rows, 1>& r, const Eigen::Matrix<double, rows, num_beam_params>& J,
         const Eigen::Matrix<double, rows, rows>& own, const Eigen::Matrix<double, rows, rows>& carried) {
  const Eigen::Matrix<double, rows, rows> all = own + carried;
  const Eigen::Matrix<double, rows, rows> weight = all.inverse();
  group.sum += r.dot(weight * r);
  group.num += rows;
  group.H += J.transpose() * weight * J;
}

/// Factor on σ that makes the residuals as large as they should be. One degree of freedom of the guess keeps few
/// residuals from showing a σ of next to nothing.
double factor_of(const Group& group, const BeamMatrix& H, int num_free, double sigma_over_guess) {
  if (group.num == 0.0) return 1.0;
  const Eigen::MatrixXd share =
      Ldlt(H.topLeftCorner(num_free, num_free)).solve_each(group.H.topLeftCorner(num_free, num_free));
  const double taken_up = std::clamp(share.trace(), 0.0, group.num);
  constexpr double dof_of_guess = 1.0;
  const double guess = dof_of_guess / (sigma_over_guess * sigma_over_guess);
  const double factor2 = (group.sum + guess) / (group.num - taken_up + dof_of_guess);
  return std::isfinite(factor2) ? std::sqrt(factor2) : 1.0;
}

struct Groups {
  Group ranges, spots;
  BeamMatrix H = BeamMatrix::Zero();
};

Groups groups_of(const BeamProblem& problem, const Camera& camera, const Beam& beam, bool of_spots) {
  Groups groups;
  for (const PreparedShot& shot : problem.shots) {
    if (!shot.used) continue;
    const auto residual = shot_residual(shot, beam, camera, problem.model);
    if (!residual) continue;
    const Eigen::MatrixXd cov = full_covariance(shot, *residual);
    if (shot.plane) {
      const Eigen::Matrix<double, 1, 1> own(residual->noise_cov(0, 0)), carried(cov(0, 0) - own[0]);
      if (!shot.sigma_range_m)
        add<1>(groups.ranges, residual->r.head<1>(), residual->J_beam.topRows<1>(), own, carried);
    }
    if (shot.spot_px && (!shot.owns_spot_sigma || !shot.plane)) {
      const Eigen::Matrix2d own = shot.sigma_spot_px * shot.sigma_spot_px * Eigen::Matrix2d::Identity();
      const Eigen::Matrix2d carried = cov.bottomRightCorner<2, 2>() - own;
      // A spot without a board holds the reading's error, too; it determines the kind that is not known.
      Group& group = shot.plane || of_spots ? groups.spots : groups.ranges;
      add<2>(group, residual->r.tail<2>(), residual->J_beam.bottomRows<2>(), own, carried);
    }
    const auto W = whitener_of(cov);
    const Eigen::Matrix<double, Eigen::Dynamic, num_beam_params, 0, 3> J = W * residual->J_beam;
    groups.H += J.transpose() * J;
  }
  return groups;
}

/// What its finder knows of a spot stays; what comes on top is so many times larger.
void scale_spot_sigma(double factor, PreparedShot& shot) {
  const double own2 = shot.min_sigma_spot_px * shot.min_sigma_spot_px;
  constexpr double never_none_px = 0.01;
  double more_px = std::sqrt(std::max(0.0, shot.sigma_spot_px * shot.sigma_spot_px - own2));
  if (own2 > 0.0) more_px = std::max(more_px, never_none_px);
  shot.sigma_spot_px = std::sqrt(own2 + factor * factor * more_px * more_px);
}

}  // namespace

double estimate_noise(BeamProblem& problem, const Camera& camera, const Beam& beam, bool of_spots, bool of_ranges) {
  const Groups groups = groups_of(problem, camera, beam, of_spots);
  double change = 0.0;
  const int p = problem.num_free();
  if (of_ranges) {
    RangeNoise& noise = problem.model.noise;
    double factor = factor_of(groups.ranges, groups.H, p, noise.sigma_m / guessed_sigma_m);
    // Spots alone: one factor for both, as their residuals hold both.
    if (groups.ranges.num == 0.0 && of_spots)
      factor = factor_of(groups.spots, groups.H, p, noise.sigma_m / guessed_sigma_m);
    noise = {noise.sigma_m * factor, noise.per_m * factor, noise.incidence_m * factor};
    change = std::abs(factor - 1.0);
  }
  if (!of_spots) return change;
  double sigma_px = guessed_sigma_px;
  for (const PreparedShot& shot : problem.shots)
    if (shot.spot_px && !shot.owns_spot_sigma) sigma_px = shot.sigma_spot_px;
  const double factor = factor_of(groups.spots, groups.H, p, sigma_px / guessed_sigma_px);
  for (PreparedShot& shot : problem.shots)
    if (!shot.owns_spot_sigma) scale_spot_sigma(factor, shot);
  return std::max(change, std::abs(factor - 1.0));
}

}  // namespace alidade
