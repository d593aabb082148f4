#include "alidade/network/moving_clusters.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Score Kᵀr and information KᵀK of some observations.
struct Pull {
  VectorXd g;
  MatrixXd A;
  void add(const Pull& other) {
    if (g.size() == 0) {
      *this = other;
      return;
    }
    g += other.g;
    A += other.A;
  }
};
using Pulls = std::map<std::pair<std::size_t, std::size_t>, Pull>;  ///< By block of time and head.

struct Gathered {
  Pulls pulls;
  std::vector<MatrixXd> lens_pull;  ///< Kᵀ by the lens, one per head.
};

/// Derivatives of an observation by the lens [px].
MatrixXd by_lens(const MovingState& state, const TurnedHead& turned, const SolvedObservation& observation,
                 const PathSpline::Support& at) {
  const RigHead& rig_head = state.heads[observation.head];
  const auto seen = project_with_jacobians(rig_head.camera, turned.point_in_cam(state.path.position(at)));
  if (!seen) return MatrixXd::Zero(2, params(rig_head.camera.lens).size());
  return seen->J_px_params;
}

Gathered gather(const MovingProblem& problem, const SolvedMoving& solved, const MatrixXd& Z, double block_s) {
  const auto n = Z.cols();
  Gathered all;
  for (const RigHead& head : solved.state.heads)
    all.lens_pull.emplace_back(MatrixXd::Zero(n, params(head.camera.lens).size()));
  const std::vector<TurnedHead> turned = turned_heads(problem, solved.state);
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const SolvedObservation& observation = problem.observations[i];
    if (!solved.used[i]) continue;
    const auto terms = observation_terms(problem, solved.state, turned, observation);
    if (!terms) continue;
    const double by = 1.0 / solved.sigma_px[observation.head];
    MatrixXd K = -by * terms->J_path * Z.middleRows(static_cast<Eigen::Index>(3 * terms->at.first), 12);
    const Eigen::Index first = problem.first_param(observation.head);
    if (first >= 0) K.middleCols(first, terms->J_common.cols()) += by * terms->J_common;
    const double from_start_s =
        solved.state.rig_time(problem, observation.head, observation.t_s) - solved.state.path.from_s;
    const auto block = static_cast<std::size_t>(std::max(0.0, from_start_s / block_s));
    all.pulls[{block, observation.head}].add({K.transpose() * (by * terms->r), K.transpose() * K});
    all.lens_pull[observation.head] +=
        K.transpose() * (by * by_lens(solved.state, turned[observation.head], observation, terms->at));
  }
  return all;
}

/// Pulls summed over what `of` distinguishes.
template <typename Of>
std::vector<Pull> summed(const Pulls& pulls, Of of) {
  std::map<std::size_t, Pull> sums;
  for (const auto& [key, pull] : pulls) sums[of(key)].add(pull);
  std::vector<Pull> out;
  for (auto& [key, pull] : sums) out.push_back(std::move(pull));
  return out;
}

/// What cameras share beyond blocks of time, in parameters in which the covariance by time is 1.
MatrixXd shared_by_cameras(const Pulls& pulls, const MatrixXd& steps_from_scores) {
  const Eigen::Index n = steps_from_scores.rows();
  MatrixXd excess = MatrixXd::Zero(n, n);
  const auto cameras = summed(pulls, [](const auto& key) { return key.second; });
  if (cameras.size() < 2) return excess;
  double noise2 = 0.0;
  const auto num = static_cast<double>(cameras.size());
  for (const Pull& camera : cameras) {
    const VectorXd x = std::sqrt(num / (num - 1.0)) * (steps_from_scores * camera.g);
    excess += x * x.transpose();
    noise2 += std::pow(x.squaredNorm(), 2);
  }
  for (const auto& [key, pull] : pulls) {
    const VectorXd x = steps_from_scores * pull.g;
    excess -= x * x.transpose();
  }
  const double distance2 = excess.squaredNorm();
  const double share = distance2 > noise2 ? 1.0 - noise2 / distance2 : 0.0;
  const SymmetricEigen eigen = symmetric_eigen(excess);
  return share * (eigen.vectors * eigen.values.cwiseMax(0.0).asDiagonal() * eigen.vectors.transpose());
}

}  // namespace

MovingClusters moving_clusters(const MovingProblem& problem, const SolvedMoving& solved, const MatrixXd& path_by_common,
                               const MatrixXd& cov) {
  constexpr double min_block_s = 2.0, min_blocks = 8.0;
  MovingClusters out;
  const PathSpline& path = solved.state.path;
  const double duration_s = path.knot_s * static_cast<double>(path.control.size());
  Gathered best;
  for (double block_s = min_block_s; out.block_s == 0.0 || block_s <= duration_s / min_blocks; block_s *= 2.0) {
    Gathered all = gather(problem, solved, path_by_common, block_s);
    std::vector<ClusterStep> steps;
    for (const Pull& block : summed(all.pulls, [](const auto& key) { return key.first; }))
      steps.push_back(cluster_step(cov, block.A, block.g));
    ClusterCovariance of_time = cluster_covariance(cov, 1.0, steps);
    if (out.block_s > 0.0 && !(of_time.design_effect > out.of_time.design_effect)) continue;
    out.block_s = block_s;
    out.of_time = std::move(of_time);
    best = std::move(all);
  }
  out.cov = out.of_time.cov;
  const Llt llt(out.cov);
  if (llt.is_positive()) {
    const MatrixXd L = llt.lower();
    out.cov += L * shared_by_cameras(best.pulls, llt.whitened(cov)) * L.transpose();
  }
  for (const MatrixXd& pull : best.lens_pull) out.by_lens.emplace_back(-cov * pull);
  return out;
}

}  // namespace alidade
