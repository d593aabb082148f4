#include "alidade/rangefinder/beam_solve.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Whitener = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;

/// Cost of another beam with the whiteners of this one: a step must not look good for having larger σ.
double cost_with(const BeamProblem& problem, const Camera& camera, const Beam& beam,
                 const std::vector<Whitener>& whiteners) {
  double cost = 0.0;
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    const PreparedShot& shot = problem.shots[i];
    if (!shot.used || shot.num_rows() == 0) continue;
    const auto residual = shot_residual(shot, beam, camera, problem.model);
    if (!residual) return std::numeric_limits<double>::infinity();
    cost += (whiteners[i] * residual->r).squaredNorm();
  }
  return cost;
}

std::optional<BeamNormals> normals_and_whiteners(const BeamProblem& problem, const Camera& camera, const Beam& beam,
                                                 std::vector<Whitener>& whiteners, bool with_lens = false) {
  BeamNormals normals;
  whiteners.resize(problem.shots.size());
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    const PreparedShot& shot = problem.shots[i];
    if (!shot.used || shot.num_rows() == 0) continue;
    const auto residual = shot_residual(shot, beam, camera, problem.model);
    if (!residual) return std::nullopt;
    whiteners[i] = whitener_of(full_covariance(shot, *residual));
    if (!whiteners[i].allFinite()) return std::nullopt;
    const Eigen::Matrix<double, Eigen::Dynamic, num_beam_params, 0, 3> J = whiteners[i] * residual->J_beam;
    const ShotResidual::Rows r = whiteners[i] * residual->r;
    normals.H.noalias() += J.transpose() * J;
    normals.g.noalias() += J.transpose() * r;
    normals.cost += r.squaredNorm();
    normals.num_rows += shot.num_rows();
    if (!with_lens) continue;
    if (normals.H_lens.cols() == 0) normals.H_lens.setZero(num_beam_params, residual->J_lens.cols());
    normals.H_lens.noalias() += J.transpose() * (whiteners[i] * residual->J_lens);
    if (shot.pose && shot.J_pose_lens.cols() > 0)
      normals.H_lens.noalias() += J.transpose() * (whiteners[i] * (residual->J_pose * shot.J_pose_lens));
  }
  return normals;
}

}  // namespace

std::optional<BeamNormals> beam_normals(const BeamProblem& problem, const Camera& camera, const Beam& beam) {
  std::vector<Whitener> whiteners;
  return normals_and_whiteners(problem, camera, beam, whiteners, true);
}

std::optional<BeamSolution> solve_beam(const BeamProblem& problem, const Camera& camera, const Beam& start) {
  std::vector<Whitener> whiteners;
  auto now = normals_and_whiteners(problem, camera, start, whiteners);
  if (!now) return std::nullopt;
  BeamSolution solution{start, false, *now, 0};
  const int p = problem.num_free();
  double damping = 1e-4;
  for (int i = 0; i < problem.max_iterations; ++i) {
    solution.iterations = i + 1;
    Eigen::MatrixXd damped = solution.normals.H.topLeftCorner(p, p);
    damped.diagonal() *= 1.0 + damping;
    BeamVector step = BeamVector::Zero();
    step.head(p) = -solve_symmetric(damped, solution.normals.g.head(p));
    if (!step.allFinite()) return solution;
    const Beam trial = solution.beam.retract(step);
    // A millionth of a σ: farther digits say nothing about the world, but nearly exact data have them.
    solution.converged = step.dot(solution.normals.H * step) < 1e-12;
    if (cost_with(problem, camera, trial, whiteners) <= solution.normals.cost) {
      now = normals_and_whiteners(problem, camera, trial, whiteners);
      if (!now) return solution;
      solution.beam = trial;
      solution.normals = *now;
      damping = std::max(0.1 * damping, 1e-12);
    } else if ((damping *= 10.0) > 1e14) {
      return solution;
    }
    if (solution.converged) return solution;
  }
  return solution;
}

double shot_chi2(const PreparedShot& shot, const Beam& beam, const Camera& camera, const ShotModel& model) {
  const auto residual = shot_residual(shot, beam, camera, model);
  if (!residual) return std::numeric_limits<double>::infinity();
  const double chi2 = (whitener_of(full_covariance(shot, *residual)) * residual->r).squaredNorm();
  return std::isfinite(chi2) ? chi2 : std::numeric_limits<double>::infinity();
}

}  // namespace alidade
