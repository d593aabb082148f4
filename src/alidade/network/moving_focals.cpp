#include "alidade/network/moving_focals.h"

#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Scores and information of one block of time, focal length by focal length.
struct BlockScore {
  VectorXd score, information;
};
using BlockScores = std::map<std::size_t, BlockScore>;

/// `F`: how the shared parameters follow the focal lengths, negated.
BlockScores gather_scores(const MovingProblem& problem, const SolvedMoving& solved, const MatrixXd& Z,
                          const MatrixXd& F) {
  const Index n = F.rows(), num = F.cols();
  std::vector<Index> column(solved.state.heads.size(), -1);
  for (std::size_t h = 0, next = 0; h < column.size(); ++h)
    if (problem.placed[h]) column[h] = n + static_cast<Index>(next++);
  BlockScores blocks;
  const std::vector<TurnedHead> turned = turned_heads(problem, solved.state);
  for (std::size_t i = 0; i < problem.observations.size(); ++i) {
    const SolvedObservation& observation = problem.observations[i];
    const auto terms = solved.used[i] ? observation_terms(problem, solved.state, turned, observation) : std::nullopt;
    if (!terms) continue;
    const double by = 1.0 / solved.sigma_px[observation.head];
    MatrixXd K = -by * terms->J_path * Z.middleRows(static_cast<Index>(3 * terms->at.first), 12);
    const Index first = problem.first_param(observation.head);
    if (first >= 0) K.middleCols(first, terms->J_common.cols()) += by * terms->J_common;
    K.col(column[observation.head]) += by * J_px_focal(solved.state, turned, observation, terms->at);
    const MatrixXd k = K.rightCols(num) - K.leftCols(n) * F;
    const double since_s = solved.state.rig_time(problem, observation.head, observation.t_s) - solved.state.path.from_s;
    BlockScore& block = blocks[static_cast<std::size_t>(std::max(0.0, since_s / solved.block_s))];
    if (block.score.size() == 0) block = {VectorXd::Zero(num), VectorXd::Zero(num)};
    block.score += k.transpose() * (by * terms->r);
    block.information += k.colwise().squaredNorm().transpose();
  }
  return blocks;
}

/// One focal length: by how much it is asked to change, and σ of that.
FocalScore focal_score(const BlockScores& blocks, Index j, double information) {
  double score = 0.0, sum = 0.0, scatter = 0.0;
  for (const auto& [at, block] : blocks) {
    score += block.score[j];
    sum += block.information[j];
  }
  FocalScore focal;
  focal.asked = -score / information;
  const double share = sum > 0.0 ? information / sum : 0.0;
  for (const auto& [at, block] : blocks)
    scatter += std::pow(block.score[j] + focal.asked * share * block.information[j], 2);
  const auto num = static_cast<double>(blocks.size());
  if (num > 1.0) scatter *= num / (num - 1.0);
  focal.sigma = std::sqrt(std::max(information, scatter)) / information;
  return focal;
}

}  // namespace

Eigen::Vector2d J_px_focal(const MovingState& state, std::span<const TurnedHead> turned,
                           const SolvedObservation& observation, const PathSpline::Support& at) {
  const RigHead& rig_head = state.heads[observation.head];
  const auto seen =
      project_with_jacobians(rig_head.camera, turned[observation.head].point_in_cam(state.path.position(at)));
  if (!seen) return Eigen::Vector2d::Zero();
  return seen->J_px_params.leftCols(2) * params(rig_head.camera.lens).head(2);
}

std::vector<FocalScore> focal_scores(const MovingProblem& problem, const SolvedMoving& solved, const PathSystem& wide) {
  constexpr double min_share = 1e-4;  // of a focal length's information, that the others leave
  const MatrixXd& S = wide.information();
  const Index n = problem.num_common(), num = S.rows() - n;
  if (num <= 0 || !(solved.block_s > 0.0)) return {};
  const Ldlt shared(S.topLeftCorner(n, n));
  if (!shared.is_positive()) return {};
  const MatrixXd S_cf = S.topRightCorner(n, num);
  const MatrixXd F = shared.inverse() * S_cf;
  const BlockScores blocks = gather_scores(problem, solved, wide.path_by_common(), F);
  std::vector<FocalScore> focals;
  Index j = 0;
  for (std::size_t h = 0; h < problem.placed.size(); ++h) {
    if (!problem.placed[h]) continue;
    const double information = S(n + j, n + j) - S_cf.col(j).dot(F.col(j));
    if (information > min_share * S(n + j, n + j)) {
      focals.push_back(focal_score(blocks, j, information));
      focals.back().head = h;
    }
    ++j;
  }
  return focals;
}

}  // namespace alidade
