#include "alidade/rangefinder/solve/refine_all.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

struct Step {
  Eigen::VectorXd common;
  std::vector<Eigen::Matrix<double, 6, 1>> poses;
  double size2 = 0.0;  ///< Squared, in σ.
};

std::optional<Step> damped_step(const CommonSystem& system, double damping) {
  Eigen::MatrixXd S = system.U;
  S.diagonal() *= 1.0 + damping;
  Eigen::VectorXd g = system.g;
  std::vector<Ldlt> factors(system.blocks.size());
  for (std::size_t i = 0; i < system.blocks.size(); ++i) {
    const auto& block = system.blocks[i];
    if (!block.has_pose) continue;
    Eigen::Matrix<double, 6, 6> V = block.V;
    V.diagonal() *= 1.0 + damping;
    factors[i] = Ldlt(V);
    S.noalias() -= block.W.transpose() * factors[i].solve_each(block.W);
    g.noalias() -= block.W.transpose() * factors[i].solve(block.g);
  }
  Step step{-solve_symmetric(S, g), std::vector<Eigen::Matrix<double, 6, 1>>(system.blocks.size()), 0.0};
  step.size2 = -step.common.dot(system.g);
  for (std::size_t i = 0; i < system.blocks.size(); ++i) {
    const auto& block = system.blocks[i];
    if (!block.has_pose) continue;
    step.poses[i] = -factors[i].solve(block.g + block.W * step.common);
    step.size2 -= step.poses[i].dot(block.g);  // −gᵀ H⁻¹ g in all
  }
  if (!step.common.allFinite() || !std::isfinite(step.size2)) return std::nullopt;
  return step;
}

CommonState moved(const CommonState& state, const Step& step, const BeamProblem& problem, const LensPrior& prior) {
  CommonState next = state;
  const int p = problem.num_free();
  BeamVector beam_step = BeamVector::Zero();
  beam_step.head(p) = step.common.head(p);
  next.beam = state.beam.retract(beam_step);
  if (!prior.free.empty()) {
    Eigen::VectorXd values = params(state.camera.lens);
    for (std::size_t i = 0; i < prior.free.size(); ++i)
      values[prior.free[i]] += step.common[p + static_cast<Eigen::Index>(i)];
    next.camera.lens = with_params(state.camera.lens, values);
  }
  for (std::size_t i = 0; i < step.poses.size(); ++i) {
    if (next.cam_from_board[i]) next.cam_from_board[i] = next.cam_from_board[i]->retract(step.poses[i]);
  }
  return next;
}

/// Covariances of beam, lens and poses from the information at the state; false where it is singular.
bool add_covariances(const BeamProblem& problem, const LensPrior& prior, RefinedBeam& refined) {
  const Eigen::MatrixXd S = refined.system.information();
  const Eigen::VectorXd scale = S.diagonal().cwiseSqrt().cwiseInverse();
  if (!scale.allFinite()) return false;
  const Ldlt ldlt(scale.asDiagonal() * S * scale.asDiagonal());
  // Scaled to a unit diagonal, a pivot of 10⁻¹³ is rounding.
  if (!(ldlt.min_pivot() > 1e-13)) return false;
  const Eigen::MatrixXd cov = scale.asDiagonal() * ldlt.inverse() * scale.asDiagonal();
  const int p = problem.num_free();
  Beam& beam = refined.state.beam;
  beam.cov.setZero();
  beam.cov.topLeftCorner(p, p) = cov.topLeftCorner(p, p);
  const auto k = static_cast<Eigen::Index>(prior.free.size());
  if (k > 0) {
    const Eigen::Index num_lens = prior.mean.size();
    beam.cov_with_lens.setZero(num_beam_params, num_lens);
    refined.state.camera.cov.setZero(num_lens, num_lens);
    refined.state.camera.cov(prior.free, prior.free) = cov.bottomRightCorner(k, k);
    beam.cov_with_lens(Eigen::seqN(0, p), prior.free) = cov.topRightCorner(p, k);
  }
  refined.poses.assign(refined.system.blocks.size(), std::nullopt);
  for (std::size_t i = 0; i < refined.poses.size(); ++i) {
    const auto& block = refined.system.blocks[i];
    if (!block.has_pose) continue;
    const Eigen::Matrix<double, 6, 6> V_inverse = inverse_symmetric(block.V);
    const Eigen::Matrix<double, 6, Eigen::Dynamic> follows = V_inverse * block.W;
    refined.poses[i] = BoardPose{*refined.state.cam_from_board[i], V_inverse + follows * cov * follows.transpose()};
  }
  return true;
}

}  // namespace

std::optional<RefinedBeam> refine_all(const BeamProblem& problem, const LensPrior& prior, const CommonState& start,
                                      int max_iterations) {
  auto system = common_system(problem, prior, start);
  if (!system) return std::nullopt;
  RefinedBeam refined{start, std::move(*system), {}, 0, max_iterations == 0, 0};
  // Quadratic as a rule. But the pose of a far and frontal board lies in a flat valley between two that look alike, and
  // creeps along it to no one's gain: from the eighth step on, six that lower the cost by less than 0.05 (0.2 σ) end
  // it.
  constexpr std::size_t window = 6;
  std::vector<double> costs;
  double damping = 1e-6;  // the start is near: the beam is solved, the poses are
  for (int i = 0; i < max_iterations && !refined.converged; ++i) {
    refined.iterations = i + 1;
    const auto step = damped_step(refined.system, damping);
    if (!step) return std::nullopt;
    costs.push_back(refined.system.cost);
    const bool creeps = costs.size() > 8 + window && costs[costs.size() - 1 - window] - costs.back() < 0.05;
    refined.converged = step->size2 < 1e-10 || creeps;  // 10⁻⁵ σ
    CommonState trial = moved(refined.state, *step, problem, prior);
    auto next = common_system(problem, prior, trial, &refined.system);
    if (next && next->cost_with_old_weights <= refined.system.cost) {
      refined.state = std::move(trial);
      refined.system = std::move(*next);
      damping = std::max(0.1 * damping, 1e-12);
    } else if ((damping *= 10.0) > 1e12) {
      break;
    }
  }
  refined.num_parameters = problem.num_free() + static_cast<int>(prior.free.size());
  for (const auto& block : refined.system.blocks) refined.num_parameters += block.has_pose ? 6 : 0;
  if (!add_covariances(problem, prior, refined)) return std::nullopt;
  return refined;
}

}  // namespace alidade
