#include "alidade/rangefinder/solve/reduced_system.h"

#include <algorithm>

#include "alidade/board/board_bend.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/solve/fixed_distortion.h"

namespace alidade {
namespace {

using Eigen::Index;

/// fx, fy, cx, cy come first in every lens; skew is none that a lens has by chance.
std::vector<int> lens_columns(const LensPrior& prior, const Camera& camera) {
  std::vector<int> columns{0, 1, 2, 3};
  for (const int parameter : prior.free)
    if (parameter > 3) columns.push_back(parameter);
  for (const int parameter : fixed_distortion(camera, prior.free)) columns.push_back(parameter);
  return columns;
}

/// What is left where the board's pose follows the errors; `by_pose`: their block with it.
void eliminate_pose(const Eigen::Matrix<double, 3, 6>& by_pose, const CommonSystem::ShotBlock& block,
                    ErrorScore& score) {
  const Ldlt V(block.V);
  score.s -= by_pose * V.solve(block.g);
  score.I -= by_pose * V.solve_each(by_pose.transpose());
  score.by_common -= by_pose * V.solve_each(block.W);
}

ErrorScore error_score(const BeamProblem& one, const LensPrior& all_of_lens, const CommonState& state,
                       const CommonSystem& system) {
  const auto k = static_cast<Index>(all_of_lens.free.size());
  ErrorScore score;
  score.by_common.setZero(3, num_beam_params + k);
  const PreparedShot shot = at_state(one.shots[0], state.cam_from_board[0]);
  if (!shot.used || shot.num_rows() == 0) return score;
  const auto residual = shot_residual(shot, state.beam, state.camera, one.model);
  if (!residual) return score;
  const auto& block = system.blocks[0];
  const Eigen::MatrixXd D = block.whitener * residual->J_errors;
  score.s = D.transpose() * (block.whitener * residual->r);
  score.I = D.transpose() * D;
  score.by_common.leftCols(num_beam_params) = D.transpose() * (block.whitener * residual->J_beam);
  score.by_common.rightCols(k) = D.transpose() * (block.whitener * residual->J_lens(Eigen::all, all_of_lens.free));
  if (!block.has_pose || !shot.plane) return score;
  eliminate_pose(D.transpose() * (block.whitener * residual->J_pose), block, score);
  return score;
}

/// Of the corners and of where the beam meets the board. A point that is higher is one of a board that is moved so far
/// along its z.
ErrorScore bend_score(const BeamProblem& one, const LensPrior& all_of_lens, const CommonState& state,
                      const CommonSystem& system) {
  constexpr int along_z = 2;  // of a pose's step
  const auto k = static_cast<Index>(all_of_lens.free.size());
  ErrorScore score;
  score.by_common.setZero(3, num_beam_params + k);
  const auto& block = system.blocks[0];
  const Rigid3& cam_from_board = *state.cam_from_board[0];
  const PreparedShot shot = at_state(one.shots[0], cam_from_board);
  const auto corners =
      corner_residuals(state.camera, cam_from_board, *shot.board, one.points_in_board, one.sigma_corner_px);
  if (!corners) return score;
  const BoardBend bend(one.points_in_board);
  Eigen::Matrix<double, Eigen::Dynamic, 3> D(corners->r.size(), 3);
  for (Index row = 0; row < D.rows(); ++row) {
    const auto point = static_cast<std::size_t>(shot.board->corners[static_cast<std::size_t>(row / 2)].index);
    D.row(row) = corners->J_pose(row, along_z) * bend.heights_at(one.points_in_board[point]).transpose();
  }
  const Eigen::Matrix<double, 3, Eigen::Dynamic> weighed = D.transpose() / (shot.corner_factor * shot.corner_factor);
  score.s = weighed * corners->r;
  score.I = weighed * D;
  score.by_common.rightCols(k) = weighed * corners->J_lens(Eigen::all, all_of_lens.free);
  Eigen::Matrix<double, 3, 6> by_pose = weighed * corners->J_pose;
  const auto residual = shot.used && shot.plane ? shot_residual(shot, state.beam, state.camera, one.model)
                                                : std::optional<ShotResidual>{};
  if (residual) {
    const Eigen::Vector3d hit = cam_from_board.inverse() * point_at(state.beam, shot.range_m);
    const Eigen::MatrixXd J_pose = block.whitener * residual->J_pose;
    const Eigen::MatrixXd J = J_pose.col(along_z) * bend.heights_at(hit).transpose();
    score.s += J.transpose() * (block.whitener * residual->r);
    score.I += J.transpose() * J;
    score.by_common.leftCols(num_beam_params) += J.transpose() * (block.whitener * residual->J_beam);
    score.by_common.rightCols(k) += J.transpose() * (block.whitener * residual->J_lens(Eigen::all, all_of_lens.free));
    by_pose += J.transpose() * J_pose;
  }
  eliminate_pose(by_pose, block, score);
  return score;
}

std::optional<ReducedShot> reduced_shot(const BeamProblem& one, const LensPrior& all_of_lens,
                                        const CommonState& state) {
  const auto system = common_system(one, all_of_lens, state);
  if (!system) return std::nullopt;
  ReducedShot shot{0, false, system->U, system->g, error_score(one, all_of_lens, state, *system), {}};
  const auto& block = system->blocks[0];
  if (!block.has_pose) return shot;
  shot.has_corners = true;
  shot.bend = bend_score(one, all_of_lens, state, *system);
  const Ldlt V(block.V);
  shot.A.noalias() -= block.W.transpose() * V.solve_each(block.W);
  shot.g.noalias() -= block.W.transpose() * V.solve(block.g);
  return shot;
}

}  // namespace

Index ReducedSystem::of_lens(int parameter) const {
  return num_beam_params + (std::find(lens.begin(), lens.end(), parameter) - lens.begin());
}

std::vector<Index> ReducedSystem::places(int num_beam, const std::vector<int>& free_lens) const {
  std::vector<Index> at;
  for (int i = 0; i < num_beam; ++i) at.push_back(of_beam(i));
  for (const int parameter : free_lens) at.push_back(of_lens(parameter));
  return at;
}

Eigen::VectorXd ReducedSystem::square_column(const Beam& beam) const {
  Eigen::VectorXd larger = Eigen::VectorXd::Zero(H.rows());
  larger.head<3>() = beam.origin_in_cam;
  larger[5] = beam.scale;
  Eigen::VectorXd column = Eigen::VectorXd::Zero(H.rows());
  for (const ReducedShot& shot : shots)
    if (shot.has_corners) column -= shot.A * larger;
  return column;
}

ReducedSystem reduced_system(const BeamProblem& problem, const LensPrior& lens_prior, const CommonState& state) {
  ReducedSystem reduced;
  reduced.lens = lens_columns(lens_prior, state.camera);
  const auto num_lens = static_cast<Index>(reduced.lens.size());
  const LensPrior all_of_lens{reduced.lens, params(state.camera.lens), Eigen::MatrixXd::Zero(num_lens, num_lens)};
  reduced.H.setZero(num_beam_params + num_lens, num_beam_params + num_lens);
  BeamProblem one{{}, problem.points_in_board, problem.model, problem.sigma_corner_px, true, problem.max_iterations};
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    one.shots.assign(1, problem.shots[i]);
    auto shot = reduced_shot(one, all_of_lens, {state.beam, state.camera, {state.cam_from_board[i]}});
    if (!shot) continue;
    shot->index = i;
    reduced.H += shot->A;
    reduced.shots.push_back(std::move(*shot));
  }
  const std::vector<Index> of_prior = reduced.places(0, lens_prior.free);
  if (!of_prior.empty()) reduced.H(of_prior, of_prior) += lens_prior.information;
  return reduced;
}

std::vector<ClusterStep> shot_clusters(const ReducedSystem& system, const std::vector<Index>& places,
                                       const Eigen::MatrixXd& inverse) {
  std::vector<ClusterStep> clusters;
  clusters.reserve(system.shots.size());
  for (const ReducedShot& shot : system.shots)
    clusters.push_back(cluster_step(inverse, shot.A(places, places), shot.g(places)));
  return clusters;
}

}  // namespace alidade
