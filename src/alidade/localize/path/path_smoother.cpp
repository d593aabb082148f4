#include "alidade/localize/path/path_smoother.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/checks/residual_structure.h"
#include "alidade/localize/filter/given_numbers.h"
#include "alidade/localize/path/path_system.h"

namespace alidade {

PathSmoother::PathSmoother(const SmootherProblem& problem) : problem_(problem) {
  if (problem.imu) lens_at_ = problem.imu->start.dim();
  estimate_lens(problem.filter.lens_params);
  sigma_estimated_ = problem.filter.sigma_lens_params;
  causes_at_ = lens_at_ + static_cast<int>(lens_order_.size());
  double num_given = 0.0;
  for (std::size_t i = 0; i < problem.points.size(); ++i) {
    index_of_[problem.points[i].id] = i;
    state_.points.push_back(problem.points[i].point_in_world);
    error_factors_.push_back(problem.points[i].error_factor);
    if (!problem.points[i].given_in_world) continue;
    target_centre_ += *problem.points[i].given_in_world;
    num_given += 1.0;
  }
  if (num_given > 0.0) target_centre_ /= num_given;
  mid_s_ = 0.5 * (problem.t_s.front() + problem.t_s.back());
  usual_variance_ = problem.usual_variance;
  state_.camera = problem.camera;
  state_.poses = problem.world_from_cam;
  given_lens_ = params(problem.camera.lens);
  begin_imu();
}

/// A point's life lasts from its first observation, or the frame of its distance prior, to its last.
void PathSmoother::find_lives() {
  lives_.assign(problem_.points.size(), std::nullopt);
  first_of_.assign(state_.poses.size() + 1, 0);
  for (std::size_t i = 0; i < observations_.size(); ++i) {
    const UsedObservation& observation = observations_[i];
    std::optional<Life>& life = lives_[point_of_[i]];
    if (!life) life = Life{observation.frame, observation.frame};
    life->last = observation.frame;
    ++first_of_[observation.frame + 1];
  }
  std::partial_sum(first_of_.begin(), first_of_.end(), first_of_.begin());
  entering_.assign(state_.poses.size(), {});
  leaving_.assign(state_.poses.size(), {});
  there_.assign(state_.poses.size(), {});
  for (std::size_t i = 0; i < lives_.size(); ++i) {
    if (!lives_[i]) continue;
    if (problem_.points[i].range) {
      lives_[i]->first = std::min(lives_[i]->first, problem_.points[i].first_frame);
      lives_[i]->last = std::max(lives_[i]->last, problem_.points[i].first_frame);
    }
    entering_[lives_[i]->first].push_back(i);
    leaving_[lives_[i]->last].push_back(i);
    for (std::size_t k = lives_[i]->first; k <= lives_[i]->last; ++k) there_[k].push_back(i);
  }
  max_at_once_ = 0;
  int num = 0;
  for (std::size_t k = 0; k < entering_.size(); ++k) {
    num += static_cast<int>(entering_[k].size());
    max_at_once_ = std::max(max_at_once_, num);
    num -= static_cast<int>(leaving_[k].size());
  }
}

SmootherState PathSmoother::moved_by(const Eigen::VectorXd& shared, const PoseChain::Steps& steps, double share) const {
  SmootherState moved = state_;
  for (std::size_t k = 0; k < steps.poses.size(); ++k) {
    moved.poses[k].translation += share * steps.poses[k].head<3>();
    moved.poses[k].rotation = (moved.poses[k].rotation * exp_so3(share * steps.poses[k].tail<3>())).normalized();
  }
  for (std::size_t i = 0; i < moved.points.size(); ++i)
    if (lives_[i]) moved.points[i] += share * steps.points[i];
  Eigen::VectorXd lens = params(moved.camera.lens);
  for (int i = 0; i < num_estimated_; ++i)
    lens[lens_order_[static_cast<std::size_t>(i)]] += share * shared[lens_at_ + i];
  moved.camera.lens = with_params(moved.camera.lens, lens);
  if (problem_.imu) moved.imu = state_.imu.moved(share * shared.head(lens_at_));
  return moved;
}

/// Builds the equations at the current state, after removing observations of points that they do not determine.
std::optional<SmootherSystem> PathSmoother::begun() {
  constexpr std::size_t few = 20;
  for (std::size_t num = 0; few * num <= state_.points.size(); ++num) {
    find_lives();
    std::optional<std::size_t> vague;
    auto system = build(state_, Shared::solved, std::numeric_limits<double>::infinity(), &vague);
    if (system || !vague) return system;
    std::erase_if(observations_, [&](const UsedObservation& each) { return index_of_.at(each.id) == *vague; });
    std::erase(point_of_, *vague);
    if (!links_.empty()) link_observations(link_correlation_);
  }
  return std::nullopt;
}

/// Makes a step that lowers the cost, a full Gauss–Newton step or else a shorter one, and returns the equations there.
/// Empty if no step does.
std::optional<SmootherSystem> PathSmoother::step_along(const SmootherSystem& system) {
  constexpr double min_share = 0.02;
  const int num = num_solved();
  const Llt llt(system.chain.B.topLeftCorner(num, num));
  if (!llt.is_positive()) return std::nullopt;
  const Eigen::VectorXd shared = llt.solve(system.chain.b.head(num));
  const auto steps = system.chain.steps(shared);
  for (double share = 1.0; share > min_share; share *= 0.5) {
    const SmootherState there = moved_by(shared, steps, share);
    auto next = build(there, Shared::solved, system.cost + 1e-9 * (1.0 + system.cost));
    if (!next) continue;
    state_ = there;
    return next;
  }
  return std::nullopt;
}

/// If none does, poorly determined components (such as the depth of a point seen along its ray) would pass through the
/// camera. Makes damped steps, until one lowers the cost; the next one may be three times as long.
std::optional<SmootherSystem> PathSmoother::short_step(double& share) {
  constexpr double least = 1e-4, shorter = 0.3, longer = 3.0;
  for (; share > least; share *= shorter) {
    step_share_ = share;
    const auto system = build(state_, Shared::solved);
    step_share_ = 0.0;
    if (!system) continue;
    auto next = step_along(*system);
    if (!next) continue;
    share *= longer;
    return next;
  }
  return std::nullopt;
}

/// Iterates until a full step would gain less than `settled` in χ². If only damped steps lower the cost, until
/// one of nearly the size of the distances gains nothing: a full step would then merely move a point to
/// infinity.
bool PathSmoother::settle(double settled) {
  constexpr int max_iterations = 25, max_short = 60;
  constexpr double short_share = 0.3, long_share = 30.0, nothing = 0.01, hardly = 0.1;
  double share = long_share;
  int num_short = 0;
  auto system = begun();
  for (int iteration = 0; system && iteration < max_iterations + num_short; ++iteration) {
    const int num = num_solved();
    const Llt llt(system->chain.B.topLeftCorner(num, num));
    if (!llt.is_positive()) return false;
    const double gain = system->chain.gain() + llt.solve(system->chain.b.head(num)).dot(system->chain.b.head(num));
    if (gain < settled) return true;
    auto next = share < long_share ? std::nullopt : step_along(*system);
    if (!next && gain < hardly) return true;
    if (!next && num_short++ < max_short) {
      if (share >= long_share) share = short_share;
      next = short_step(share);
      if (next && share > short_share && system->cost - next->cost < nothing) return true;
    }
    system = std::move(next);
  }
  return false;
}

bool PathSmoother::choose_observations() {
  std::vector<UsedObservation> chosen;
  std::vector<std::size_t> point_of;
  bool is_other = false;
  std::size_t next = 0;
  for (const UsedObservation& observation : problem_.observations) {
    const auto point = index_of_.find(observation.id);
    const bool was_there = next < observations_.size() && observations_[next].frame == observation.frame &&
                           observations_[next].id == observation.id;
    next += was_there ? 1 : 0;
    if (point == index_of_.end()) continue;
    const auto px = project(state_.camera, state_.poses[observation.frame].inverse() * state_.points[point->second]);
    const bool fits = px && (*px - observation.px).squaredNorm() <= gate_of(observation, point->second);
    is_other = is_other || fits != was_there;
    if (!fits) continue;
    chosen.push_back(observation);
    point_of.push_back(point->second);
  }
  observations_ = std::move(chosen);
  point_of_ = std::move(point_of);
  return is_other;
}

/// Iterates with the observations that fit until their selection is stable; then models weights and autocorrelation.
bool PathSmoother::settle_all() {
  constexpr double roughly = 0.3;
  if (!settle(roughly)) return false;
  const int max_choices = problem_.imu ? 6 : 3;
  for (int i = 0; i < max_choices; ++i) {
    const bool has_other_walks = choose_walks();  // before the selection of observations changes
    const bool has_others = choose_observations(), has_other_steps = choose_steps();
    if (!has_others && !has_other_steps && !has_other_walks) break;
    if (!settle(roughly)) return false;
  }
  return heed_colour();
}

std::optional<SmoothedPath> PathSmoother::solve() {
  if (problem_.freed_lens) {
    state_.camera.lens = *problem_.freed_lens;
    free_lens();
  }
  for (const UsedObservation& observation : problem_.observations) {
    const auto point = index_of_.find(observation.id);
    if (!observation.fits_start || point == index_of_.end() ||
        !project(state_.camera, state_.poses[observation.frame].inverse() * state_.points[point->second]))
      continue;
    observations_.push_back(observation);
    point_of_.push_back(point->second);
  }
  if (!settle_all()) return std::nullopt;
  const auto system = build(state_, Shared::all);
  if (!system) return std::nullopt;
  if (problem_.frees_lens && asks_for_lens(*system)) {
    PathSmoother freed = *this;
    freed.free_lens();
    if (freed.settle_all())
      if (const auto there = freed.build(freed.state_, Shared::all)) return freed.finished(*there);
  }
  return finished(*system);
}

SmoothedPath PathSmoother::finished(const SmootherSystem& system) {
  SmoothedPath path = result(system);
  path.structure = residual_structure(path.residuals, state_.camera);
  path.structure.autocorrelation = structure_.autocorrelation;  // that before the correlation was modelled
  path.structure.sigma_autocorrelation = structure_.sigma_autocorrelation;
  path.num_dropped = problem_.observations.size() - observations_.size();
  if (std::ranges::any_of(problem_.points, [](const SmootherPoint& point) { return point.given_in_world.has_value(); }))
    widen(system.cost, path);
  count_hidden(path);
  return path;
}

void PathSmoother::fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const {
  path.camera = state_.camera;
  path.sigma_lens = cov.diagonal().segment(lens_at_, num_estimated_).cwiseSqrt();
  path.is_lens_freed = is_lens_freed_;
  path.estimated.assign(lens_order_.begin(), lens_order_.begin() + num_estimated_);
  const Eigen::VectorXd now = params(state_.camera.lens);
  for (int i = 0; i < num_estimated_ && !is_lens_freed_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double sigma = sigma_estimated_[at];
    path.lens_pull = std::max(path.lens_pull, std::abs(now[lens_order_[at]] - given_lens_[lens_order_[at]]) / sigma);
  }
}

void PathSmoother::fill_map(std::span<const Eigen::Matrix3d> covs, SmoothedPath& path) const {
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    if (!lives_[i]) continue;
    path.points.push_back(state_.points[i]);
    path.point_covs.push_back(covs[i]);
    path.ids.push_back(problem_.points[i].id);
    path.error_factors.push_back(error_factors_[i]);
  }
  path.usual_variance = usual_variance_;
  path.residuals = placed_residuals();
  for (const PlacedResidual& residual : path.residuals)
    path.chi2_per_dof += residual.residual_px.squaredNorm() / (residual.sigma_px * residual.sigma_px);
  const double num_numbers = 2.0 * static_cast<double>(path.residuals.size());
  const double num_solved = 6.0 * static_cast<double>(state_.poses.size()) + 3.0 * static_cast<double>(path.ids.size());
  path.chi2_per_dof /= std::max(num_numbers - num_solved, 0.5 * num_numbers + 1.0);
}

/// A common delay of all times changes no observation: it is unobservable.
void PathSmoother::add_clock(SmoothedPath& path) const {
  GivenNumber clock{.name = "clock"};
  for (std::size_t k = 0; k < state_.poses.size(); ++k) {
    Twist twist = twist_at(state_, k);
    twist.head<3>() = state_.poses[k].rotation.conjugate() * twist.head<3>();
    take_move(twist, path.cov[k], clock);
  }
  path.given.push_back(clock);
}

/// Minus half the derivative of the motion's cost along a direction of the shared parameters, with poses and points
/// following it: its part of the score.
double PathSmoother::motion_score(const SmootherSystem& system, const Eigen::VectorXd& direction,
                                  const PoseChain::Steps& at_rest) const {
  const PoseChain::Steps moved = system.chain.steps(direction);
  double score = 0.0;
  for (std::size_t k = 0; k < moved.poses.size(); ++k)
    score += system.motion_pull.poses[k].dot(moved.poses[k] - at_rest.poses[k]);
  for (std::size_t i = 0; i < moved.points.size(); ++i)
    if (lives_[i]) score += system.motion_pull.points[i].dot(moved.points[i] - at_rest.points[i]);
  return score;
}

/// The scores contain observations and priors, not the motion: pixel noise makes a still camera appear to move, a
/// little less with a longer lens, and the gain in accelerations would grow with the number of frames.
PathSmoother::Asked PathSmoother::asked(const SmootherSystem& system) const {
  const int num = num_solved(), all = causes_at_ + num_causes, rest = all - num;
  const Eigen::MatrixXd B = system.chain.B.topLeftCorner(all, all).selfadjointView<Eigen::Lower>();
  const Llt llt(B.topLeftCorner(num, num));
  Asked asked{Eigen::MatrixXd::Identity(all, rest), {}, system.chain.b.segment(num, rest)};
  asked.J.topRows(num) = -llt.solve_each(B.topRightCorner(num, rest));
  asked.J.bottomRows(rest).setIdentity();
  asked.information = B.bottomRightCorner(rest, rest) + B.bottomLeftCorner(rest, num) * asked.J.topRows(num);
  asked.score += asked.J.topRows(num).transpose() * system.chain.b.head(num);
  const PoseChain::Steps at_rest = system.chain.steps(Eigen::VectorXd::Zero(all));
  for (int i = 0; i < rest; ++i) asked.score[i] -= motion_score(system, asked.J.col(i), at_rest);
  return asked;
}

SmoothedPath PathSmoother::result(const SmootherSystem& system) const {
  const int num = num_solved();
  const Llt llt(system.chain.B.topLeftCorner(num, num));
  const Eigen::MatrixXd considered = considered_cov();
  const Asked asked = this->asked(system);
  Eigen::MatrixXd cov = asked.J * considered * asked.J.transpose();
  cov.topLeftCorner(num, num) += llt.inverse();
  PoseChain::Spread spread = system.chain.spread(cov, asked.J);
  SmoothedPath path;
  fill_imu(system, cov, asked, path);
  align(system, considered, spread);
  path.world_from_cam = state_.poses;
  fill_map(spread.point_cov, path);
  path.radial = radial_structure(path.residuals, state_.camera, structure_.is_autocorrelated(),
                                 moves_by_lens(considered, asked, spread));
  for (std::size_t k = 0; k < state_.poses.size(); ++k) {
    Eigen::Matrix<double, 6, 6> to_camera = Eigen::Matrix<double, 6, 6>::Identity();
    to_camera.topLeftCorner<3, 3>() = state_.poses[k].rotation.toRotationMatrix().transpose();
    path.cov.push_back(to_camera * spread.cov[k] * to_camera.transpose());
    spread.J[k] = to_camera * spread.J[k];
  }
  fill_frame(system, considered, spread, path);
  fill_lens(cov, path);
  const std::vector<int> given(lens_order_.begin() + num_estimated_, lens_order_.end());
  path.given = given_numbers(
      {problem_.camera, given, considered, asked.score, asked.information, asked.information, spread.J, path.cov});
  fill_hidden(spread, path);
  add_clock(path);
  return path;
}

std::optional<SmoothedPath> smoothed_path(const SmootherProblem& problem) {
  if (problem.world_from_cam.size() < 3 || problem.points.empty()) return std::nullopt;
  return PathSmoother(problem).solve();
}

}  // namespace alidade
