#include <Eigen/Cholesky>
#include <cmath>

#include "alidade/geometry/decompositions.h"

#include "alidade/rangefinder/solve/refine_all.h"

namespace alidade {
namespace {

using Block = CommonSystem::ShotBlock;

/// The lens' part of the normal equations moves to where the free parameters stand among the common ones.
bool add_corners(const BeamProblem& problem, const LensPrior& prior, const CommonState& state, std::size_t i,
                 CommonSystem& system) {
  auto corners = corner_residuals(state.camera, *state.cam_from_board[i], *problem.shots[i].board,
                                  problem.points_in_board, problem.sigma_corner_px);
  if (!corners) return false;
  const double weight = 1.0 / std::pow(problem.shots[i].corner_factor, 2);
  const auto k = static_cast<Eigen::Index>(prior.free.size());
  const Eigen::MatrixXd J_lens = corners->J_lens(Eigen::all, prior.free);
  Block& block = system.blocks[i];
  block.V.noalias() += weight * corners->J_pose.transpose() * corners->J_pose;
  block.g.noalias() += weight * corners->J_pose.transpose() * corners->r;
  block.W.rightCols(k).noalias() += weight * corners->J_pose.transpose() * J_lens;
  system.U.bottomRightCorner(k, k).noalias() += weight * J_lens.transpose() * J_lens;
  system.g.tail(k).noalias() += weight * J_lens.transpose() * corners->r;
  const double cost = weight * corners->r.squaredNorm();
  system.cost += cost;
  system.cost_with_old_weights += cost;
  system.num_residuals += static_cast<int>(corners->r.size());
  return true;
}

bool add_laser(const BeamProblem& problem, const LensPrior& prior, const CommonState& state, std::size_t i,
               const Block* old, CommonSystem& system) {
  const bool has_pose = state.cam_from_board[i].has_value();
  const PreparedShot shot = at_state(problem.shots[i], state.cam_from_board[i]);
  const auto residual = shot_residual(shot, state.beam, state.camera, problem.model);
  if (!residual) return false;
  Block& block = system.blocks[i];
  block.whitener = whitener_of(full_covariance(shot, *residual));
  if (!block.whitener.allFinite()) return false;
  const int p = problem.num_free();
  const auto k = static_cast<Eigen::Index>(prior.free.size());
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, 3, 24> J(residual->r.size(), p + k);
  J.leftCols(p) = block.whitener * residual->J_beam.leftCols(p);
  J.rightCols(k) = block.whitener * residual->J_lens(Eigen::all, prior.free);
  const ShotResidual::Rows r = block.whitener * residual->r;
  system.U.noalias() += J.transpose() * J;
  system.g.noalias() += J.transpose() * r;
  if (has_pose && shot.plane) {
    const Eigen::Matrix<double, Eigen::Dynamic, 6, 0, 3> J_pose = block.whitener * residual->J_pose;
    block.V.noalias() += J_pose.transpose() * J_pose;
    block.W.noalias() += J_pose.transpose() * J;
    block.g.noalias() += J_pose.transpose() * r;
  }
  system.cost += r.squaredNorm();
  system.cost_with_old_weights += old ? (old->whitener * residual->r).squaredNorm() : r.squaredNorm();
  system.num_residuals += static_cast<int>(r.size());
  return true;
}

void add_prior(const LensPrior& prior, const Camera& camera, CommonSystem& system) {
  const auto k = static_cast<Eigen::Index>(prior.free.size());
  if (k == 0) return;
  const Eigen::VectorXd away = (params(camera.lens) - prior.mean)(prior.free);
  const double cost = away.dot(prior.information * away);
  system.U.bottomRightCorner(k, k) += prior.information;
  system.g.tail(k) += prior.information * away;
  system.cost += cost;
  system.cost_with_old_weights += cost;
  system.num_residuals += static_cast<int>(k);
}

}  // namespace

PreparedShot at_state(const PreparedShot& shot, const std::optional<Rigid3>& cam_from_board) {
  PreparedShot moved = shot;
  if (!shot.plane || !cam_from_board) return moved;
  moved.pose = BoardPose{*cam_from_board, Eigen::Matrix<double, 6, 6>::Zero()};
  moved.plane = plane_of(*cam_from_board);
  return moved;
}

LensPrior lens_prior(const Camera& camera, bool with_distortion) {
  LensPrior prior;
  prior.mean = params(camera.lens);
  if (camera.cov.rows() != prior.mean.size() || camera.cov.cols() != prior.mean.size()) return prior;
  if (!camera.cov.allFinite()) return prior;
  constexpr int num_intrinsics = 4;  // fx, fy, cx, cy come first in every lens
  for (int i = 0; i < prior.mean.size(); ++i) {
    if (camera.cov(i, i) > 0.0 && (with_distortion || i < num_intrinsics)) prior.free.push_back(i);
  }
  if (prior.free.empty()) return prior;
  const Eigen::MatrixXd cov = camera.cov(prior.free, prior.free);
  const Eigen::VectorXd sigma = cov.diagonal().cwiseSqrt();
  const Eigen::MatrixXd correlation = sigma.cwiseInverse().asDiagonal() * cov * sigma.cwiseInverse().asDiagonal();
  const SymmetricEigen eigen = symmetric_eigen(correlation);
  const Eigen::VectorXd values = eigen.values.cwiseMax(1e-10 * eigen.values.maxCoeff());
  const Eigen::MatrixXd V = sigma.cwiseInverse().asDiagonal() * eigen.vectors;
  prior.information = V * values.cwiseInverse().asDiagonal() * V.transpose();
  return prior;
}

Eigen::MatrixXd CommonSystem::information() const {
  Eigen::MatrixXd S = U;
  for (const ShotBlock& block : blocks) {
    if (block.has_pose) S.noalias() -= block.W.transpose() * Ldlt(block.V).solve_each(block.W);
  }
  return S;
}

std::optional<CommonSystem> common_system(const BeamProblem& problem, const LensPrior& prior, const CommonState& state,
                                          const CommonSystem* old) {
  const auto size = problem.num_free() + static_cast<Eigen::Index>(prior.free.size());
  CommonSystem system{Eigen::MatrixXd::Zero(size, size), Eigen::VectorXd::Zero(size), {}, 0.0, 0.0, 0};
  system.blocks.resize(problem.shots.size());
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    const PreparedShot& shot = problem.shots[i];
    Block& block = system.blocks[i];
    block.W.setZero(6, size);
    block.has_pose = state.cam_from_board[i].has_value();
    if (block.has_pose && !add_corners(problem, prior, state, i, system)) return std::nullopt;
    if (!shot.used || shot.num_rows() == 0) continue;
    const Block* old_block = old && old->blocks[i].whitener.size() > 0 ? &old->blocks[i] : nullptr;
    if (!add_laser(problem, prior, state, i, old_block, system)) return std::nullopt;
  }
  add_prior(prior, state.camera, system);
  return system;
}

}  // namespace alidade
