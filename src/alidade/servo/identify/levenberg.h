#pragma once

#include <Eigen/Core>
#include <algorithm>

#include "alidade/geometry/decompositions.h"
#include "alidade/servo/identify/identify.h"

namespace alidade {

/// The parameters after a step, with time constant and latency kept within a meaningful range.
[[nodiscard]] inline ServoParams within_meaning(const ServoParams& from, ServoParams next) {
  constexpr double fastest_tau_s = 1e-5;
  next[ServoParam::tau] = std::max({next[ServoParam::tau], 0.2 * from[ServoParam::tau], fastest_tau_s});
  next[ServoParam::latency] = std::max(next[ServoParam::latency], 0.0);
  return next;
}

struct LevenbergConfig {
  int max_steps = 60;
  double first_damping = 1e-6;
  double tolerance = 1e-12;  ///< Converged if a step reduces the squares by less than this fraction.
  double ridge = 0.0;        ///< Added to the diagonal of the normal equations, relative to its largest element.
  /// If the steps are used up, it has also converged if the last ones together moved it by less than a hundredth of σ:
  /// near a kink (a latency at which a command meets a row) steps become ever shorter.
  static constexpr int last_steps = 10;
};
struct LevenbergOutcome {
  double sum2 = 0.0;
  bool has_converged = false;
};

/// Minimises |misfit(state)|² from `state` by damped Gauss–Newton steps, state = after(state, step).
/// `jacobian_at(state, misfit)`: finite differences start from the known misfit.
/// K. Levenberg, "A method for the solution of certain non-linear problems in least squares", 1944, with the scaling of
/// D. W. Marquardt, 1963.
template <class State, class Misfit, class Jacobian, class After>
LevenbergOutcome levenberg(const LevenbergConfig& config, State& state, const Misfit& misfit_at,
                           const Jacobian& jacobian_at, const After& after) {
  Eigen::VectorXd misfit = misfit_at(state);
  auto J = jacobian_at(state, misfit);
  LevenbergOutcome outcome{misfit.squaredNorm(), false};
  double damping = config.first_damping, before2 = outcome.sum2;
  for (int i = 0; i < config.max_steps && !outcome.has_converged; ++i) {
    if (i == config.max_steps - LevenbergConfig::last_steps) before2 = outcome.sum2;
    auto JtJ = (J.transpose() * J).eval();
    JtJ.diagonal() *= 1.0 + damping;
    if (config.ridge > 0.0) JtJ.diagonal().array() += config.ridge * JtJ.diagonal().maxCoeff() + 1e-300;
    const State next = after(state, (-solve_symmetric(JtJ, J.transpose() * misfit)).eval());
    Eigen::VectorXd tried = misfit_at(next);
    const double tried2 = tried.squaredNorm();
    if (!(tried2 <= outcome.sum2)) {
      damping *= 10.0;
      outcome.has_converged = damping > 1e8;
      continue;
    }
    outcome.has_converged = outcome.sum2 - tried2 <= config.tolerance * outcome.sum2;
    state = next;
    misfit = std::move(tried);
    outcome.sum2 = tried2;
    damping = std::max(1e-9, 0.1 * damping);
    if (!outcome.has_converged) J = jacobian_at(state, misfit);
  }
  const double still2 = 1e-4 * outcome.sum2 / std::max(1.0, static_cast<double>(misfit.size()));
  outcome.has_converged |= config.max_steps >= LevenbergConfig::last_steps && before2 - outcome.sum2 <= still2;
  return outcome;
}

}  // namespace alidade
