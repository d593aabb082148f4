#include "alidade/network/moving_given.h"

#include <algorithm>
#include <cmath>
#include <string>

#include "alidade/network/camera_scores.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::VectorXd;
constexpr double usual_f = 0.003, usual_centre_px = 2.0, usual_k1 = 0.01, usual_distance = 0.005, usual_time_s = 0.02,
                 usual_turn_rad = 0.02;

struct Given {
  Assumption what;
  VectorXd moved;  ///< Of the shared parameters, for its σ or an ordinary error.
};

void add_lens(const RigHead& rig_head, const Eigen::MatrixXd& follows, std::vector<Given>& all, MovingGiven& given) {
  const VectorXd values = params(rig_head.camera.lens);
  const Eigen::MatrixXd& cov = rig_head.camera.cov;
  const bool has_cov = cov.rows() == values.size();
  const auto add = [&](const char* name, Index param, double ordinary, const VectorXd& step) {
    Given one{{.name = "head" + std::to_string(rig_head.head.id) + ".camera." + name, .value = values[param]}, {}};
    if (has_cov) one.what.sigma = std::sqrt(std::max(0.0, cov(param, param)));
    one.what.ordinary = ordinary;
    one.what.remedy = "give camera files with their covariance (alidade calibrate writes it)";
    one.moved = step * one.what.sigma.value_or(ordinary);
    all.push_back(std::move(one));
  };
  VectorXd by_f = follows.col(0);
  if (!has_cov) by_f += values[1] / values[0] * follows.col(1);  // both focal lengths err together
  add("fx", 0, usual_f * values[0], by_f);
  add("cx", 2, usual_centre_px, follows.col(2));
  add("cy", 3, usual_centre_px, follows.col(3));
  if (has_cov) given.cov += follows * cov * follows.transpose();
}

constexpr double ordinary_of(CameraPart part) {
  switch (part) {
    case CameraPart::focal:
      return 1.0;
    case CameraPart::k1:
      return usual_k1;
    case CameraPart::cx:
    case CameraPart::cy:
      return usual_centre_px;
    case CameraPart::clock:
    case CameraPart::shutter:
    case CameraPart::shutter_from_top:
      return usual_time_s;
    default:
      return usual_turn_rad;
  }
}

/// A camera that the observations half ask to be another may be that.
void carry_asked(const SolvedMoving& solved, const CameraScore& one, Eigen::MatrixXd& cov) {
  constexpr double hardly = 2.5;
  const bool is_lens = one.part <= CameraPart::k1;
  // What they hardly determine they may ask for by chance, and far too much of it.
  if (one.sigmas() < hardly || std::hypot(one.sigma, one.given) > ordinary_of(one.part)) return;
  if (is_lens && !lens_param_of(solved.state.heads[one.head].camera, one.part)) return;
  const VectorXd moved = one.asked * one.follows;
  cov += moved * moved.transpose();
}

/// All positions follow the distance in proportion, seen from the camera that is fixed.
void add_distance(const MovingProblem& problem, const SolvedMoving& solved, const KnownDistance& distance,
                  std::vector<Given>& all) {
  const auto centre = [&](std::size_t h) {
    return cam_centre_in_world(solved.state.heads[h].head, problem.readings[h]);
  };
  VectorXd step = VectorXd::Zero(problem.num_common());
  for (std::size_t h = 0; h < solved.state.heads.size(); ++h) {
    const Index at = problem.first_param(h);
    if (at < 0) continue;
    step.segment<3>(at) = solved.state.heads[h].head.world_from_base.rotation.conjugate() *
                          ((centre(h) - centre(problem.reference)) / distance.distance_m);
  }
  Given one{{.name = "distance_m", .value = distance.distance_m, .ordinary = usual_distance * distance.distance_m}, {}};
  if (distance.sigma_m > 0.0) one.what.sigma = distance.sigma_m;
  one.what.remedy = "give the distance's σ: --distance HEAD:HEAD:M:SIGMA";
  one.moved = step * one.what.sigma.value_or(one.what.ordinary);
  all.push_back(std::move(one));
}

/// The pose that it moves most, in that one's σ.
void set_moves(const MovingProblem& problem, const SolvedMoving& solved, const Eigen::MatrixXd& cov, Given& one) {
  for (std::size_t h = 0; h < solved.state.heads.size(); ++h) {
    const Index at = problem.first_param(h);
    for (Index k = 0; at >= 0 && k < 6; ++k) {
      const double sigma = std::sqrt(cov(at + k, at + k)), moved = one.moved[at + k];
      if (!(std::abs(moved) > one.what.moves * sigma)) continue;
      one.what.moves = std::abs(moved) / sigma;
      one.what.moved =
          "head" + std::to_string(solved.state.heads[h].head.id) + "." + head_param_names[static_cast<std::size_t>(k)];
      one.what.moved_by = moved;
    }
  }
}

}  // namespace

MovingGiven moving_given(const MovingProblem& problem, const SolvedMoving& solved, const MovingTargetConfig& config) {
  MovingGiven given{{}, solved.cov, solved.scores};
  std::vector<Given> all;
  for (std::size_t h = 0; h < solved.state.heads.size(); ++h)
    if (problem.placed[h]) add_lens(solved.state.heads[h], solved.by_lens[h], all, given);
  if (config.distance) add_distance(problem, solved, *config.distance, all);
  for (const CameraScore& one : given.scores) carry_asked(solved, one, given.cov);
  for (Given& one : all) {
    set_moves(problem, solved, given.cov, one);
    given.assumed.push_back(std::move(one.what));
  }
  return given;
}

}  // namespace alidade
