#include "alidade/rangefinder/solve/beam_solve.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Whitener = Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 3>;

/// Normal equations at a beam, and the cost there with the whiteners of the beam before: a step must not look good for
/// having larger σ.
struct Linearised {
  BeamNormals normals;
  std::vector<Whitener> whiteners;
  double cost_as_before = 0.0;
};

std::optional<Linearised> linearised(const BeamProblem& problem, const Camera& camera, const Beam& beam,
                                     const std::vector<Whitener>* before = nullptr, bool with_lens = false) {
  Linearised out;
  BeamNormals& normals = out.normals;
  out.whiteners.resize(problem.shots.size());
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    const PreparedShot& shot = problem.shots[i];
    if (!shot.used || shot.num_rows() == 0) continue;
    const auto residual = shot_residual(shot, beam, camera, problem.model);
    if (!residual) return std::nullopt;
    if (before) out.cost_as_before += ((*before)[i] * residual->r).squaredNorm();
    const Whitener& whitener = out.whiteners[i] = whitener_of(full_covariance(shot, *residual));
    if (!whitener.allFinite()) return std::nullopt;
    const Eigen::Matrix<double, Eigen::Dynamic, num_beam_params, 0, 3> J = whitener * residual->J_beam;
    const ShotResidual::Rows r = whitener * residual->r;
    normals.H.noalias() += J.transpose() * J;
    normals.g.noalias() += J.transpose() * r;
    normals.cost += r.squaredNorm();
    normals.num_rows += shot.num_rows();
    if (!with_lens) continue;
    if (normals.H_lens.cols() == 0) normals.H_lens.setZero(num_beam_params, residual->J_lens.cols());
    normals.H_lens.noalias() += J.transpose() * (whitener * residual->J_lens);
    if (shot.pose && shot.J_pose_lens.cols() > 0)
      normals.H_lens.noalias() += J.transpose() * (whitener * (residual->J_pose * shot.J_pose_lens));
  }
  return out;
}

}  // namespace

std::optional<BeamNormals> beam_normals(const BeamProblem& problem, const Camera& camera, const Beam& beam) {
  auto at = linearised(problem, camera, beam, nullptr, true);
  return at ? std::optional(std::move(at->normals)) : std::nullopt;
}

std::optional<BeamSolution> solve_beam(const BeamProblem& problem, const Camera& camera, const Beam& start) {
  auto now = linearised(problem, camera, start);
  if (!now) return std::nullopt;
  BeamSolution solution{start, false, now->normals, 0};
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
    auto next = linearised(problem, camera, trial, &now->whiteners);
    if (next && next->cost_as_before <= solution.normals.cost) {
      now = std::move(next);
      solution.beam = trial;
      solution.normals = now->normals;
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
