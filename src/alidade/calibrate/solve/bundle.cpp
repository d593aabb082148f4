#include "alidade/calibrate/solve/bundle.h"

#include <cmath>
#include <limits>
#include <utility>

#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Pose6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// The reduced system after the poses are eliminated, scaled to unit diagonal, and what takes a step back to them.
struct Reduced {
  Eigen::MatrixXd S;  ///< Lower triangle, of the unscaled unknowns.
  Eigen::VectorXd rhs;
  std::vector<PoseFactor> factors;
  bool ok = true;
};

/// Adds −YᵀY for stacked rows Y (6 per view): in batches, as one large product is faster than many small ones.
void subtract_outer(const Eigen::MatrixXd& Y, Eigen::MatrixXd& S) {
  S.selfadjointView<Eigen::Lower>().rankUpdate(Y.transpose(), -1.0);
}

/// Schur complement of the poses with Marquardt damping λ on every diagonal.
Reduced reduce(const NormalEquations& eq, double lambda) {
  Reduced reduced;
  reduced.S = eq.H;
  reduced.S.diagonal() *= 1.0 + lambda;
  reduced.rhs = -eq.gradient;
  reduced.factors.reserve(eq.V.size());
  constexpr Eigen::Index batch_views = 32;
  Eigen::MatrixXd Y(6 * batch_views, eq.num_globals);
  Eigen::Index filled = 0;
  for (std::size_t k = 0; k < eq.V.size(); ++k) {
    Pose6 V = eq.V[k];
    V.diagonal() *= 1.0 + lambda;
    reduced.factors.emplace_back(V);
    if (!reduced.factors.back().ok()) {
      reduced.ok = false;
      return reduced;
    }
    if (eq.num_globals == 0) continue;  // the poses alone: nothing to reduce
    auto rows = Y.middleRows<6>(filled);
    rows = eq.coupling(k).transpose();
    reduced.factors.back().solve_lower(rows);
    Vector6 gradient = eq.pose_gradient[k];
    reduced.factors.back().solve_lower(gradient);
    reduced.rhs += rows.transpose() * gradient;
    filled += 6;
    if (filled == Y.rows()) {
      subtract_outer(Y, reduced.S);
      filled = 0;
    }
  }
  if (filled > 0) subtract_outer(Y.topRows(filled), reduced.S);
  return reduced;
}

Eigen::VectorXd unit_scale(const Eigen::MatrixXd& S) {
  return S.diagonal().cwiseMax(std::numeric_limits<double>::min()).cwiseSqrt().cwiseInverse();
}

/// Solution of S x = rhs, scaled to unit diagonal. None where S is not positive definite.
std::optional<Eigen::VectorXd> solve_scaled(const Eigen::MatrixXd& S, const Eigen::VectorXd& rhs) {
  if (S.size() == 0) return Eigen::VectorXd(0);
  const Eigen::VectorXd scale = unit_scale(S);
  const Llt llt(scaled_by(scale, S));
  if (!llt.is_positive()) return std::nullopt;
  Eigen::VectorXd x = scale.cwiseProduct(llt.solve(scale.cwiseProduct(rhs)));
  if (!x.allFinite()) return std::nullopt;
  return x;
}

BundleState step_from(const BundleProblem& problem, const BundleState& state, const Eigen::VectorXd& globals,
                      const std::vector<Vector6>& poses) {
  BundleState next = state;
  Eigen::VectorXd lens = params(state.lens);
  for (std::size_t i = 0; i < problem.free_lens.size(); ++i) {
    lens[problem.free_lens[i]] += globals[static_cast<Eigen::Index>(i)];
  }
  next.lens = with_params(state.lens, lens);
  for (std::size_t k = 0; k < poses.size(); ++k) next.cam_from_board[k] = state.cam_from_board[k].retract(poses[k]);
  const auto at = static_cast<Eigen::Index>(problem.free_lens.size());
  if (problem.shape == BoardShape::bow) {
    const BowBasis basis = bow_basis(problem.printed_points);
    for (std::size_t i = 0; i < next.board_points.size(); ++i) {
      next.board_points[i].z() += basis.along_x[i] * globals[at] + basis.along_y[i] * globals[at + 1];
    }
  } else if (problem.shape == BoardShape::free) {
    for (std::size_t i = 0; i < next.board_points.size(); ++i) {
      next.board_points[i] += globals.segment<3>(at + 3 * static_cast<Eigen::Index>(i));
    }
  }
  return next;
}

/// One damped step, or none where the damped system is not positive definite. `decrease`: predicted fall of the cost.
struct Step {
  BundleState state;
  double decrease = 0.0;
};

std::optional<Step> damped_step(const BundleProblem& problem, const BundleState& state, const NormalEquations& eq,
                                double lambda) {
  const Reduced reduced = reduce(eq, lambda);
  if (!reduced.ok) return std::nullopt;
  const auto globals = solve_scaled(reduced.S, reduced.rhs);
  if (!globals) return std::nullopt;
  std::vector<Vector6> poses(eq.V.size());
  double decrease = -globals->dot(eq.gradient);
  for (std::size_t k = 0; k < poses.size(); ++k) {
    poses[k] = -eq.pose_gradient[k] - eq.coupling(k).transpose() * *globals;
    reduced.factors[k].solve(poses[k]);
    if (!poses[k].allFinite()) return std::nullopt;
    decrease -= poses[k].dot(eq.pose_gradient[k]);
  }
  return Step{step_from(problem, state, *globals, poses), decrease};
}

/// Inverse of a matrix with unit diagonal; none where it is singular: then its weakest direction is in `result`.
std::optional<Eigen::MatrixXd> inverse_of(const Eigen::MatrixXd& scaled, BundleResult& result) {
  constexpr double surely_regular = 1e-11;  // 1/|S⁻¹| (Frobenius) is a lower bound of the smallest eigenvalue
  const Llt llt(scaled);
  if (llt.is_positive()) {
    Eigen::MatrixXd inverse = llt.inverse();
    if (inverse.norm() * surely_regular < 1.0) return inverse;
  }
  const SymmetricEigen eigen = symmetric_eigen(scaled);
  result.weakest = eigen.vectors.col(0);
  constexpr double singular = 1e-13;  // below this the smallest eigenvalue is rounding
  if (!(eigen.values[0] > singular)) return std::nullopt;
  return eigen.vectors * eigen.values.cwiseInverse().asDiagonal() * eigen.vectors.transpose();
}

double degrees_of_freedom(const BundleProblem& problem) {
  double rows = 0.0;
  for (const ViewArrays& view : problem.views) rows += 2.0 * static_cast<double>(view.size()) - 6.0;
  return std::max(1.0, rows - num_globals(problem));
}

}  // namespace

BundleResult with_covariance(BundleResult result) {
  if (result.status != BundleResult::Status::converged) return result;
  const NormalEquations& eq = *result.equations;
  Reduced reduced = reduce(eq, 0.0);
  if (!reduced.ok) {
    result.status = BundleResult::Status::singular;
    return result;
  }
  if (eq.num_globals == 0) return result;  // poses alone
  const Eigen::VectorXd scale = unit_scale(reduced.S);
  Eigen::MatrixXd scaled = reduced.S.selfadjointView<Eigen::Lower>();
  scaled = scale.asDiagonal() * scaled * scale.asDiagonal();
  const std::optional<Eigen::MatrixXd> inverse = inverse_of(scaled, result);
  if (!inverse) {
    result.status = BundleResult::Status::singular;
    return result;
  }
  result.cov = scale.asDiagonal() * *inverse * scale.asDiagonal();
  result.pose_factors = std::make_shared<const std::vector<PoseFactor>>(std::move(reduced.factors));
  return result;
}

std::vector<Pose6> pose_covariances(const BundleResult& result, double noise_variance, const Eigen::MatrixXd& cov) {
  const NormalEquations& eq = *result.equations;
  constexpr int few = Columns::max_lens + 2;  // lens and bow: products of small matrices, done before they are packed
  using SmallGain = Eigen::Matrix<double, 6, Eigen::Dynamic, Eigen::ColMajor, 6, few>;
  std::vector<Pose6> covs(eq.V.size(), noise_variance * Pose6::Identity());
  for (std::size_t k = 0; k < covs.size(); ++k) {
    const PoseFactor& V = (*result.pose_factors)[k];
    V.solve(covs[k]);
    if (eq.num_globals <= few) {
      SmallGain gain = eq.coupling(k).transpose();
      V.solve(gain);
      const SmallGain by_cov = gain.lazyProduct(cov);
      covs[k].noalias() += by_cov.lazyProduct(gain.transpose());
    } else {
      Eigen::Matrix<double, 6, Eigen::Dynamic> gain = eq.coupling(k).transpose();
      V.solve(gain);
      covs[k] += gain * cov * gain.transpose();
    }
  }
  return covs;
}

BundleResult solve_bundle(const BundleProblem& problem, BundleState start, const BundleConfig& config) {
  BundleResult result;
  result.state = std::move(start);
  result.status = BundleResult::Status::no_convergence;
  NormalEquations eq, trial;
  if (!linearize(problem, result.state, eq)) return result;
  const double dof = degrees_of_freedom(problem);
  const double tolerance2 = config.tolerance_sigmas * config.tolerance_sigmas;
  // A long lens and a far board leave a curved valley a millionth as stiff as the rest: more damping than this makes
  // the solve creep along it.
  constexpr double min_lambda = 1e-9;
  double lambda = config.first_lambda;
  for (; result.iterations < config.max_iterations && lambda < 1e12; ++result.iterations) {
    auto step = damped_step(problem, result.state, eq, lambda);
    // The step moves nothing by more than the tolerance (or 10⁻⁸ px): with it we are there.
    const double small = tolerance2 * eq.cost / dof + 1e-16 * dof;
    if (step && lambda <= 1e-3 && step->decrease <= small) {
      // Damping shortens steps along a weak valley: the whole one says whether there is still a way to go.
      auto whole = lambda > min_lambda ? damped_step(problem, result.state, eq, 0.0) : std::nullopt;
      const bool goes_on =
          whole && whole->decrease > small && linearize(problem, whole->state, trial) && trial.cost < eq.cost;
      result.state = std::move(whole && (goes_on || whole->decrease <= small) ? whole->state : step->state);
      if (!goes_on) result.status = BundleResult::Status::converged;
      if (!goes_on) break;
      std::swap(eq, trial);
      lambda = 0.0;
      continue;
    }
    if (!step || !linearize(problem, step->state, trial) || !(trial.cost <= eq.cost)) {
      lambda = std::max(10.0 * lambda, min_lambda);
      continue;
    }
    result.state = std::move(step->state);
    std::swap(eq, trial);
    lambda = lambda <= min_lambda ? 0.0 : lambda * 0.1;
  }
  result.cost = eq.cost;
  result.equations = std::make_shared<const NormalEquations>(std::move(eq));
  return result;
}

namespace {

/// Share of the corners that count and that a state's lens does not see.
double share_unseen(const BundleProblem& problem, const BundleState& state) {
  double unseen = 0.0, count = 0.0;
  for (std::size_t k = 0; k < problem.views.size(); ++k) {
    const std::vector<Eigen::Vector2d> residuals = residuals_px(state, k, problem.views[k]);
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      if (!(problem.views[k].white_c[i] > 0.0)) continue;
      unseen += residuals[i].allFinite() ? 0.0 : 1.0;
      count += 1.0;
    }
  }
  return unseen / std::max(1.0, count);
}

}  // namespace

BundleResult solve_past_fold(BundleProblem problem, BundleState start, const BundleConfig& config) {
  BundleResult result = solve_bundle(problem, std::move(start), config);
  if (result.status == BundleResult::Status::converged || !std::holds_alternative<Calibrated<Brown>>(result.state.lens))
    return result;
  problem.passes_fold = true;
  BundleResult beyond = solve_bundle(problem, result.state, config);
  beyond.iterations += result.iterations;
  problem.passes_fold = false;
  // Where it loses more than a few corners, it is no lens, and the corners on this side show more of the fault.
  constexpr double max_unseen = 0.1;
  if (share_unseen(problem, beyond.state) > max_unseen) return result;
  NormalEquations inside;
  if (!linearize(problem, beyond.state, inside)) beyond.status = BundleResult::Status::no_convergence;
  return beyond;
}

std::vector<Eigen::Vector2d> residuals_px(const BundleState& state, std::size_t view_index, const ViewArrays& view) {
  return residuals_px(prepare(state.lens), state.cam_from_board[view_index], make_arrays(state.board_points), view);
}

std::optional<Rigid3> refine_pose(const Lens& lens, const std::vector<Eigen::Vector3d>& board_points,
                                  const ViewArrays& view, const Rigid3& cam_from_board) {
  BundleProblem problem;
  problem.views = {&view, 1};
  problem.prior_value = params(lens);
  problem.prior_information = Eigen::VectorXd::Zero(problem.prior_value.size());
  const BundleResult result = solve_bundle(problem, {lens, {cam_from_board}, board_points}, {.max_iterations = 30});
  if (result.status == BundleResult::Status::no_convergence) return std::nullopt;
  return result.state.cam_from_board.front();
}

}  // namespace alidade
