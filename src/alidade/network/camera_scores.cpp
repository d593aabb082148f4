#include "alidade/network/camera_scores.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// Scores and information of one block of time, part by part.
struct BlockScore {
  VectorXd score, information;
};
using BlockScores = std::map<std::size_t, BlockScore>;

/// `F`: how the shared parameters follow the parts, negated.
BlockScores gather_scores(const MovingProblem& problem, const SolvedMoving& solved, const MatrixXd& Z,
                          const MatrixXd& F) {
  const Index n = F.rows(), num = F.cols();
  std::vector<Index> column(solved.state.heads.size(), -1);
  for (std::size_t h = 0, next = 0; h < column.size(); ++h)
    if (problem.placed[h]) column[h] = n + num_camera_parts * static_cast<Index>(next++);
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
    K.middleCols<num_camera_parts>(column[observation.head]) +=
        by * J_px_parts(problem, solved.state, turned, observation, terms->at);
    const MatrixXd k = K.rightCols(num) - K.leftCols(n) * F;
    const double since_s = solved.state.rig_time(problem, observation.head, observation.t_s) - solved.state.path.from_s;
    BlockScore& block = blocks[static_cast<std::size_t>(std::max(0.0, since_s / solved.block_s))];
    if (block.score.size() == 0) block = {VectorXd::Zero(num), VectorXd::Zero(num)};
    block.score += k.transpose() * (by * terms->r);
    block.information += k.colwise().squaredNorm().transpose();
  }
  return blocks;
}

/// One part: by how much it is asked to change, and σ of that.
CameraScore part_score(const BlockScores& blocks, Index j, double information) {
  double score = 0.0, sum = 0.0, scatter = 0.0;
  for (const auto& [at, block] : blocks) {
    score += block.score[j];
    sum += block.information[j];
  }
  CameraScore one;
  one.asked = -score / information;
  const double share = sum > 0.0 ? information / sum : 0.0;
  for (const auto& [at, block] : blocks)
    scatter += std::pow(block.score[j] + one.asked * share * block.information[j], 2);
  const auto num = static_cast<double>(blocks.size());
  if (num > 1.0) scatter *= num / (num - 1.0);
  one.sigma = std::sqrt(std::max(information, scatter)) / information;
  one.gain = one.asked * one.asked * information;
  return one;
}

/// σ of what is tested of a lens, as its file states it; 0: as if exact.
double given_sigma(const Camera& camera, CameraPart part) {
  const auto at = lens_param_of(camera, part);
  if (!at || *at >= camera.cov.rows()) return 0.0;
  const double sigma = std::sqrt(std::max(0.0, camera.cov(*at, *at)));
  return part == CameraPart::focal ? sigma / params(camera.lens)[0] : sigma;
}

}  // namespace

std::optional<Index> lens_param_of(const Camera& camera, CameraPart part) {
  constexpr std::array<const char*, num_camera_parts> names{"fx", "cx", "cy", "k1"};
  const std::vector<std::string> all = param_names(camera.lens);
  if (part > CameraPart::k1) return std::nullopt;
  const auto found = std::ranges::find(all, names[static_cast<std::size_t>(part)]);
  if (found == all.end()) return std::nullopt;
  return static_cast<Index>(found - all.begin());
}

Eigen::Matrix<double, 2, num_camera_parts> J_px_parts(const MovingProblem& problem, const MovingState& state,
                                                      std::span<const TurnedHead> turned,
                                                      const SolvedObservation& observation,
                                                      const PathSpline::Support& at) {
  const RigHead& rig_head = state.heads[observation.head];
  const Eigen::Vector3d point_in_cam = turned[observation.head].point_in_cam(state.path.position(at));
  const auto seen = project_with_jacobians(rig_head.camera, point_in_cam);
  Eigen::Matrix<double, 2, num_camera_parts> J = Eigen::Matrix<double, 2, num_camera_parts>::Zero();
  if (!seen) return J;
  const VectorXd lens = params(rig_head.camera.lens);
  J.col(0) = seen->J_px_params.leftCols(2) * lens.head(2);
  J.middleCols<2>(1) = seen->J_px_params.middleCols(2, 2);
  // Of lenses without a k1 as well: r² along the ray's own direction in the image.
  J.col(3) =
      point_in_cam.head<2>().squaredNorm() / (point_in_cam.z() * point_in_cam.z()) * (seen->px - lens.segment<2>(2));
  const PathSpline& path = state.path;
  const Eigen::Vector2d by_time =
      seen->J_px_point * (turned[observation.head].cam_from_world_rotation * path.velocity(at));
  if (!problem.clocks_are_free) J.col(4) = -by_time;
  if (rig_head.camera.height_px > 0) {
    const double down = observation.px.y() / rig_head.camera.height_px;
    J.col(5) = (down - 0.5) * by_time;
    if (!problem.clocks_are_free) J.col(6) = down * by_time;
  }
  // From −½ to ½ over the path.
  const double along = (state.rig_time(problem, observation.head, observation.t_s) - path.from_s) /
                           (path.knot_s * static_cast<double>(path.control.size())) -
                       0.5;
  const Eigen::Vector3d in_base = rig_head.head.world_from_base.inverse() * path.position(at);
  J.middleCols<3>(7) = along * seen->J_px_point * turned[observation.head].J_point_base(in_base).rightCols(3);
  return J;
}

std::vector<CameraScore> camera_scores(const MovingProblem& problem, const SolvedMoving& solved,
                                       const PathSystem& wide) {
  constexpr double min_share = 1e-4;  // of a part's information, that the others leave
  const MatrixXd& S = wide.information();
  const Index n = problem.num_common(), num = S.rows() - n;
  if (num <= 0 || !(solved.block_s > 0.0)) return {};
  const Ldlt shared(S.topLeftCorner(n, n));
  if (!shared.is_positive()) return {};
  const MatrixXd S_cf = S.topRightCorner(n, num);
  const MatrixXd F = shared.inverse() * S_cf;
  const MatrixXd I = S.bottomRightCorner(num, num) - S_cf.transpose() * F;
  const BlockScores blocks = gather_scores(problem, solved, wide.path_by_common(), F);
  std::vector<std::size_t> heads;
  VectorXd sigmas = VectorXd::Zero(num);
  for (std::size_t h = 0; h < problem.placed.size(); ++h)
    if (problem.placed[h]) heads.push_back(h);
  const auto part_of = [](Index j) { return static_cast<CameraPart>(j % num_camera_parts); };
  const auto head_of = [&](Index j) { return heads[static_cast<std::size_t>(j / num_camera_parts)]; };
  for (Index j = 0; j < num; ++j) sigmas[j] = given_sigma(solved.state.heads[head_of(j)].camera, part_of(j));
  std::vector<CameraScore> scores;
  for (Index j = 0; j < num; ++j) {
    if (!(I(j, j) > min_share * S(n + j, n + j))) continue;
    CameraScore& one = scores.emplace_back(part_score(blocks, j, I(j, j)));
    one.head = head_of(j);
    one.part = part_of(j);
    one.follows = -F.col(j);
    one.given = (I.row(j).transpose().cwiseProduct(sigmas) / I(j, j)).norm();
  }
  return scores;
}

}  // namespace alidade
