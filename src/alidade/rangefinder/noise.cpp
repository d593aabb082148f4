#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/solve/beam_search.h"

namespace alidade {
namespace {

/// One kind of noise: squared residuals, as far as they are of it, and what the beam takes up of them.
struct Group {
  double sum = 0.0;
  double num = 0.0;
  BeamMatrix H = BeamMatrix::Zero();
};

/// Adds rows of covariance `all`, of which `kind` is the kind's noise: a residual counts for it by the share of it that
/// is the kind's (the score of ln σ²), so that spots that say little, whose σ may be larger than their errors, say
/// nothing of the readings' noise.
template <int rows>
void add(Group& group, const Eigen::Matrix<double, rows, 1>& r, const Eigen::Matrix<double, rows, num_beam_params>& J,
         const Eigen::Matrix<double, rows, rows>& kind, const Eigen::Matrix<double, rows, rows>& all) {
  const Eigen::Matrix<double, rows, rows> weight = all.inverse(), of_kind = weight * kind * weight;
  group.sum += r.dot(of_kind * r);
  group.num += (weight * kind).trace();
  group.H += J.transpose() * of_kind * J;
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
  Group ranges, spots, readings;  ///< `readings`: their share of spots that brought a σ of their own.
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
      const Eigen::Matrix<double, 1, 1> all(cov(0, 0));
      if (!shot.sigma_range_m) add<1>(groups.ranges, residual->r.head<1>(), residual->J_beam.topRows<1>(), all, all);
    }
    if (shot.spot_px && (!shot.owns_spot_sigma || !shot.plane)) {
      const Eigen::Matrix2d own = shot.sigma_spot_px * shot.sigma_spot_px * Eigen::Matrix2d::Identity();
      const Eigen::Matrix2d all = cov.bottomRightCorner<2, 2>(), of_reading = all - own;
      const Eigen::Vector2d r = residual->r.tail<2>();
      const Eigen::Matrix<double, 2, num_beam_params> J = residual->J_beam.bottomRows<2>();
      // A spot without a board holds the reading's error, too; it determines the kind that is not known.
      if (shot.plane || of_spots) add<2>(groups.spots, r, J, all, all);
      if (!shot.plane && !of_spots) add<2>(groups.ranges, r, J, of_reading, all);
      if (!shot.plane && shot.min_sigma_spot_px > 0.0) add<2>(groups.readings, r, J, of_reading, all);
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
    // Spots alone: one factor for both, as their residuals hold both, but where the spots' finder knows more of theirs.
    if (groups.ranges.num == 0.0 && of_spots)
      factor = factor_of(groups.readings.num > 0.0 ? groups.readings : groups.spots, groups.H, p,
                         noise.sigma_m / guessed_sigma_m);
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
