#include "alidade/rig/rig_clusters.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

/// A symmetric positive matrix to a power; values below `least` count as it.
Eigen::MatrixXd power_of(const Eigen::MatrixXd& symmetric, double power, double least) {
  const SymmetricEigen eigen = symmetric_eigen(symmetric);
  const Eigen::VectorXd values = eigen.values.cwiseMax(least).array().pow(power);
  return eigen.vectors * values.asDiagonal() * eigen.vectors.transpose();
}

constexpr double min_rest = 1e-3;  // of a residual's variance: as cluster_covariance() has it

}  // namespace

std::optional<ViewEquations> view_equations(const RigProblem& problem, const SolvedRig& solved, std::size_t view) {
  const auto at = view_residuals(problem, solved.state, view);
  if (!at) return std::nullopt;
  const auto& board = solved.system.boards[problem.views[view].board];
  const Eigen::Matrix2d E = at->J_correction.transpose() * at->J_correction;
  const Eigen::MatrixXd moved =
      at->J_board - at->J_correction * (E.inverse() * (at->J_correction.transpose() * at->J_board));
  const SymmetricEigen gram = symmetric_eigen(moved.transpose() * moved);
  const double least = 1e-10 * gram.values.maxCoeff();
  const Eigen::Index num = (gram.values.array() > least).count();
  ViewEquations out;
  out.Q = moved * gram.vectors.rightCols(num) * gram.values.tail(num).cwiseSqrt().cwiseInverse().asDiagonal();
  out.y = out.Q.transpose() * at->r;
  out.K_board = out.Q.transpose() * at->J_board;
  out.G = -out.K_board * Ldlt(board.V).solve_each(board.W);
  out.G.middleCols(problem.first_free(problem.views[view].head), at->J_head.cols()) += out.Q.transpose() * at->J_head;
  return out;
}

std::vector<ClusterStep> view_cluster_steps(const RigProblem& problem, const SolvedRig& solved,
                                            const Eigen::MatrixXd& cov, std::span<const double> weights) {
  std::vector<ClusterStep> steps;
  const Eigen::MatrixXd L = Llt(cov).lower();
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!(weights[v] > 0.0)) continue;
    const auto at = view_equations(problem, solved, v);
    if (!at) continue;
    const auto& board = solved.system.boards[problem.views[v].board];
    const Eigen::MatrixXd pull = at->G * L;  // by parameters of covariance 1
    const Eigen::MatrixXd taken =
        pull * pull.transpose() + at->K_board * Ldlt(board.V).solve_each(Eigen::MatrixXd(at->K_board.transpose()));
    const Eigen::Index k = at->y.size(), n = cov.rows();
    const Eigen::VectorXd own =
        power_of(Eigen::MatrixXd::Identity(k, k) - taken, -0.5, min_rest) * at->y;  // CR2, heads and boards
    const Eigen::MatrixXd h = pull.transpose() * pull;
    // cluster_covariance() will make it larger again by what the heads take.
    const Eigen::VectorXd x = power_of(Eigen::MatrixXd::Identity(n, n) - h, 0.5, min_rest) * (pull.transpose() * own);
    steps.push_back({L * x, L * h * L.transpose()});
  }
  return steps;
}

}  // namespace alidade
