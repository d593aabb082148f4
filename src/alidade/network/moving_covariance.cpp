#include <algorithm>
#include <cmath>
#include <tuple>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/network/moving_given.h"

namespace alidade {
namespace {

/// Covariance of the heads by the names of a rig's, from that of the solver's parameters.
Eigen::MatrixXd of_heads(const MovingProblem& problem, const Eigen::MatrixXd& common, double scale) {
  const std::size_t num_heads = problem.placed.size();
  const Eigen::Index num = num_head_params * static_cast<Eigen::Index>(num_heads);
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num, num);
  for (std::size_t h = 0; h < num_heads; ++h) {
    const Eigen::Index from_h = problem.first_param(h), to_h = num_head_params * static_cast<Eigen::Index>(h);
    for (std::size_t k = 0; from_h >= 0 && k < num_heads; ++k) {
      const Eigen::Index from_k = problem.first_param(k), to_k = num_head_params * static_cast<Eigen::Index>(k);
      if (from_k < 0) continue;
      Eigen::Matrix<double, 6, 6> block = common.block<6, 6>(from_h, from_k);
      block.topRows<3>() *= scale;
      block.leftCols<3>() *= scale;
      cov.block<6, 6>(to_h, to_k) = block;
    }
  }
  return cov;
}

/// What one σ of the scale moves, the reference staying where it is.
Eigen::VectorXd by_scale(const MovingProblem& problem, const Rig& rig, double sigma_scale) {
  Eigen::VectorXd moved = Eigen::VectorXd::Zero(num_head_params * static_cast<Eigen::Index>(problem.placed.size()));
  const auto centre = [&](std::size_t h) { return cam_centre_in_world(rig.heads[h].head, problem.readings[h]); };
  for (std::size_t h = 0; h < problem.placed.size(); ++h) {
    if (problem.first_param(h) < 0) continue;
    moved.segment<3>(num_head_params * static_cast<Eigen::Index>(h)) =
        rig.heads[h].head.world_from_base.rotation.conjugate() *
        (sigma_scale * (centre(h) - centre(problem.reference)));
  }
  return moved;
}

/// What each of seven independent errors of one σ of the similarity moves. The reference moves, too.
Eigen::MatrixXd by_similarity(const MovingProblem& problem, const Rig& rig, const PathMatch& match) {
  Eigen::MatrixXd moved = Eigen::MatrixXd::Zero(num_head_params * static_cast<Eigen::Index>(problem.placed.size()), 7);
  const Eigen::Matrix<double, 7, 7> by = Llt(match.cov.topLeftCorner<7, 7>()).lower();
  for (std::size_t h = 0; h < problem.placed.size(); ++h) {
    if (!problem.placed[h]) continue;
    const Head& head = rig.heads[h].head;
    const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
    const Eigen::Matrix3d base_from_world = head.world_from_base.rotation.conjugate().toRotationMatrix();
    const Eigen::Vector3d base = head.world_from_base.translation - match.middle;
    const Eigen::Vector3d centre = cam_centre_in_world(head, problem.readings[h]) - match.middle;
    Eigen::Matrix<double, 3, 7> place;
    place << base_from_world, -base_from_world * cross_matrix(base), base_from_world * centre;
    moved.block<3, 7>(at, 0) = place * by;
    moved.block<3, 7>(at + base_rotation_param, 0) = base_from_world * by.middleRows<3>(3);
  }
  return moved;
}

/// The worst head's σ of position [m] and of attitude [rad].
std::pair<double, double> worst_sigmas(const Eigen::MatrixXd& cov) {
  std::pair<double, double> worst;
  for (Eigen::Index at = 0; at < cov.rows(); at += num_head_params) {
    const auto variance = cov.diagonal().segment<num_head_params>(at);
    worst.first = std::max(worst.first, std::sqrt(variance.head<3>().sum()));
    worst.second = std::max(worst.second, std::sqrt(variance.segment<3>(base_rotation_param).sum()));
  }
  return worst;
}

}  // namespace

void take_covariance(const MovingProblem& problem, const MovingGiven& given, const Eigen::MatrixXd& cov_model,
                     const PathMatch* match, MovingTargetReport& report) {
  const double scale = match != nullptr ? match->truth_from_path.scale : 1.0;
  const double sigma_scale = match != nullptr ? match->sigma_scale() : 0.0;
  report.assumed = given.assumed;
  report.scores = given.scores;
  report.cov_model = of_heads(problem, cov_model, scale);
  report.sigma_scale = sigma_scale;
  const Eigen::MatrixXd of_cameras = of_heads(problem, given.cov, scale);
  const Eigen::VectorXd longer = by_scale(problem, report.rig, sigma_scale);
  report.rig.cov = of_cameras + longer * longer.transpose();
  std::tie(report.sigma_relative_m, report.sigma_relative_rad) = worst_sigmas(report.rig.cov);
  if (match == nullptr) return;
  const Eigen::MatrixXd moved = by_similarity(problem, report.rig, *match);
  report.rig.cov = of_cameras + moved * moved.transpose();
  std::tie(report.sigma_world_m, report.sigma_world_rad) = worst_sigmas(report.rig.cov);
}

}  // namespace alidade
