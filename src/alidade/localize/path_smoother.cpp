#include "alidade/localize/path_smoother.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <map>

#include "alidade/localize/given_numbers.h"
#include "alidade/localize/pose_chain.h"

namespace alidade {
namespace {

struct SmootherState {
  Camera camera;
  std::vector<Rigid3> poses;
  std::vector<Eigen::Vector3d> points;
};

struct SmootherSystem {
  PoseChain chain;
  double cost = 0.0;
};

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using WindowRows = Eigen::Matrix<double, 6, PoseChain::window>;

void add_window(const WindowRows& J, const Eigen::Vector<double, 6>& error, const Eigen::Vector<double, 6>& variance,
                SmootherSystem& system) {
  const WindowRows weighted = variance.cwiseInverse().asDiagonal() * J;
  system.chain.A += J.transpose() * weighted;
  system.chain.a -= weighted.transpose() * error;
  system.cost += error.cwiseAbs2().cwiseQuotient(variance).sum();
}

Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& phi) { return right_jacobian(phi).inverse(); }

/// Noise of the mean speed over `n` steps of a walk with unit steps, and what of it is left to the end.
double walked_before(double n) { return (n + 1.0) * (2.0 * n + 1.0) / (6.0 * n); }
double walked_after(double n) { return (n - 1.0) * (2.0 * n - 1.0) / (6.0 * n); }

class PathSmoother {
 public:
  explicit PathSmoother(const SmootherProblem& problem) : problem_(problem), sights_(problem.sights) {
    const int num_lens = static_cast<int>(params(problem.camera.lens).size());
    lens_at_ = 3 * static_cast<int>(problem.points.size());
    lens_order_ = problem.filter.lens_params;
    num_estimated_ = static_cast<int>(lens_order_.size());
    for (int i = 0; i < num_lens; ++i)
      if (std::ranges::find(problem.filter.lens_params, i) == problem.filter.lens_params.end())
        lens_order_.push_back(i);
    scale_at_ = lens_at_ + num_lens;
    for (std::size_t i = 0; i < problem.points.size(); ++i) index_of_[problem.points[i].id] = i;
    state_.camera = problem.camera;
    state_.poses = problem.world_from_cam;
    for (const SmootherPoint& point : problem.points) state_.points.push_back(point.point_in_world);
    told_lens_ = params(problem.camera.lens);
  }

  std::optional<SmoothedPath> solve();

 private:
  [[nodiscard]] int num_solved() const { return lens_at_ + num_estimated_; }
  [[nodiscard]] bool settle();
  [[nodiscard]] std::optional<SmootherSystem> build(const SmootherState& state) const;
  [[nodiscard]] SmootherState moved_by(const Eigen::VectorXd& border, std::span<const Eigen::Vector<double, 6>> poses,
                                       double share) const;
  void add_told(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] bool add_sight(const SmootherState& state, const UsedSight& sight, SmootherSystem& system) const;
  void add_range(const SmootherState& state, std::size_t point, SmootherSystem& system) const;
  struct Speeds {
    Eigen::Vector<double, 6> values;
    Matrix6 J_from, J_to;
  };
  [[nodiscard]] Speeds speeds(const SmootherState& state, std::size_t i) const;
  void add_motion(const SmootherState& state, std::size_t k, SmootherSystem& system) const;
  void add_start(const SmootherState& state, SmootherSystem& system) const;
  [[nodiscard]] std::size_t drop_beyond_gate();
  [[nodiscard]] Eigen::MatrixXd lens_information() const;
  [[nodiscard]] Eigen::MatrixXd considered_cov() const;
  void fill_map(const Eigen::MatrixXd& cov, SmoothedPath& path) const;
  void fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const;
  [[nodiscard]] SmoothedPath result(const SmootherSystem& system) const;

  const SmootherProblem& problem_;
  std::vector<UsedSight> sights_;
  std::map<long, std::size_t> index_of_;
  std::vector<int> lens_order_;  ///< Those estimated, then the others.
  int num_estimated_ = 0, lens_at_ = 0, scale_at_ = 0;
  Eigen::VectorXd told_lens_;
  SmootherState state_;
};

/// Of what was told of the estimated part of the lens: its covariance where the file has one, else the filter's σ.
Eigen::MatrixXd PathSmoother::lens_information() const {
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num_estimated_, num_estimated_);
  const bool has_cov = problem_.camera.cov.size() > 0;
  for (int i = 0; i < num_estimated_; ++i) {
    const double sigma = problem_.filter.sigma_lens_params[static_cast<std::size_t>(i)];
    for (int j = 0; has_cov && j < num_estimated_; ++j)
      cov(i, j) =
          problem_.camera.cov(lens_order_[static_cast<std::size_t>(i)], lens_order_[static_cast<std::size_t>(j)]);
    if (!(cov(i, i) > 0.0)) cov(i, i) = sigma * sigma;
  }
  return cov.inverse();
}

/// Of what is given and not estimated: the rest of the lens, and the target's scale.
Eigen::MatrixXd PathSmoother::considered_cov() const {
  const int num_rest = static_cast<int>(lens_order_.size()) - num_estimated_;
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num_rest + 1, num_rest + 1);
  cov(num_rest, num_rest) = problem_.sigma_scale * problem_.sigma_scale;
  if (problem_.camera.cov.size() == 0) return cov;
  const auto at = [&](int i) { return lens_order_[static_cast<std::size_t>(num_estimated_ + i)]; };
  for (int i = 0; i < num_rest; ++i)
    for (int j = 0; j < num_rest; ++j) cov(i, j) = problem_.camera.cov(at(i), at(j));
  return cov;
}

/// Known points, and what was told of the lens.
void PathSmoother::add_told(const SmootherState& state, SmootherSystem& system) const {
  PoseChain& chain = system.chain;
  for (std::size_t i = 0; i < problem_.points.size(); ++i) {
    const SmootherPoint& point = problem_.points[i];
    if (!point.told_in_world) continue;
    const double weight = 1.0 / (point.sigma_m * point.sigma_m);
    const Eigen::Vector3d error = state.points[i] - *point.told_in_world;
    const auto at = static_cast<Eigen::Index>(3 * i);
    chain.B.diagonal().segment<3>(at).array() += weight;
    chain.B.block<1, 3>(scale_at_, at) -= weight * point.told_in_world->transpose();
    chain.B(scale_at_, scale_at_) += weight * point.told_in_world->squaredNorm();
    chain.b.segment<3>(at) -= weight * error;
    chain.b[scale_at_] += weight * error.dot(*point.told_in_world);
    system.cost += weight * error.squaredNorm();
  }
  if (num_estimated_ == 0) return;
  const Eigen::MatrixXd information = lens_information();
  const Eigen::VectorXd now = params(state.camera.lens);
  Eigen::VectorXd error(num_estimated_);
  for (int i = 0; i < num_estimated_; ++i) {
    const int at = lens_order_[static_cast<std::size_t>(i)];
    error[i] = now[at] - told_lens_[at];
  }
  chain.B.block(lens_at_, lens_at_, num_estimated_, num_estimated_) += information;
  chain.b.segment(lens_at_, num_estimated_) -= information * error;
  system.cost += error.dot(information * error);
}

bool PathSmoother::add_sight(const SmootherState& state, const UsedSight& sight, SmootherSystem& system) const {
  const std::size_t point = index_of_.at(sight.id);
  Feature feature;
  feature.values.head<3>() = state.points[point];
  const auto view = expected_view(state.camera, state.poses[sight.frame], feature);
  if (!view) return false;
  const double weight = 1.0 / sight.sigma_px;
  const Eigen::Vector2d error = weight * (view->px - sight.px);
  const Eigen::Matrix<double, 2, 6> J_pose = weight * view->J_px_pose;
  const Eigen::Matrix<double, 2, 3> J_point = weight * view->J_px_feature.leftCols<3>();
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 16> J_lens(2, view->J_px_lens.cols());
  for (Eigen::Index i = 0; i < J_lens.cols(); ++i)
    J_lens.col(i) = weight * view->J_px_lens.col(lens_order_[static_cast<std::size_t>(i)]);
  PoseChain& chain = system.chain;
  const auto at = static_cast<Eigen::Index>(3 * point), num_lens = J_lens.cols();
  chain.A.topLeftCorner<6, 6>() += J_pose.transpose() * J_pose;
  chain.U.block<6, 3>(0, at) += J_pose.transpose() * J_point;
  chain.U.block(0, lens_at_, 6, num_lens) += J_pose.transpose() * J_lens;
  chain.B.block<3, 3>(at, at) += J_point.transpose() * J_point;
  chain.B.block(lens_at_, at, num_lens, 3) += J_lens.transpose() * J_point;
  chain.B.block(lens_at_, lens_at_, num_lens, num_lens) += J_lens.transpose() * J_lens;
  chain.a.head<6>() -= J_pose.transpose() * error;
  chain.b.segment<3>(at) -= J_point.transpose() * error;
  chain.b.segment(lens_at_, num_lens) -= J_lens.transpose() * error;
  system.cost += error.squaredNorm();
  return true;
}

/// What was believed of a point's distance where it was first seen, as an inverse one.
void PathSmoother::add_range(const SmootherState& state, std::size_t point, SmootherSystem& system) const {
  const SmootherPoint& told = problem_.points[point];
  const Eigen::Vector3d from_camera = state.points[point] - state.poses[told.first_frame].translation;
  const double distance_m = from_camera.norm(), weight = told.range->range_m / told.range->sigma_rel;
  const double error = weight * (1.0 / distance_m - 1.0 / told.range->range_m);
  const Eigen::Vector3d J =
      -weight / std::pow(distance_m, 3) * from_camera;  // by the point; by the position, minus that
  PoseChain& chain = system.chain;
  const auto at = static_cast<Eigen::Index>(3 * point);
  chain.A.topLeftCorner<3, 3>() += J * J.transpose();
  chain.U.block<3, 3>(0, at) -= J * J.transpose();
  chain.B.block<3, 3>(at, at) += J * J.transpose();
  chain.a.head<3>() += J * error;
  chain.b.segment<3>(at) -= J * error;
  system.cost += error * error;
}

/// Speed and rate between frame i and the next.
PathSmoother::Speeds PathSmoother::speeds(const SmootherState& state, std::size_t i) const {
  const double dt_s = problem_.t_s[i + 1] - problem_.t_s[i];
  const Eigen::Vector3d phi = log_so3(state.poses[i].rotation.conjugate() * state.poses[i + 1].rotation);
  Speeds out{{}, Matrix6::Zero(), Matrix6::Zero()};
  out.values << (state.poses[i + 1].translation - state.poses[i].translation) / dt_s, phi / dt_s;
  out.J_from.topLeftCorner<3, 3>() = -Eigen::Matrix3d::Identity() / dt_s;
  out.J_to.topLeftCorner<3, 3>() = Eigen::Matrix3d::Identity() / dt_s;
  out.J_from.bottomRightCorner<3, 3>() = -inverse_right_jacobian(-phi) / dt_s;
  out.J_to.bottomRightCorner<3, 3>() = inverse_right_jacobian(phi) / dt_s;
  return out;
}

/// Speed and rate from frame k to the next, and from there to the one after it, differ by drawn accelerations; the
/// first differ from what was told.
void PathSmoother::add_motion(const SmootherState& state, std::size_t k, SmootherSystem& system) const {
  const auto steps = [&](std::size_t i) {
    return std::max(1.0, std::round((problem_.t_s[i + 1] - problem_.t_s[i]) / problem_.period_s));
  };
  Eigen::Vector<double, 6> step_variance;
  step_variance << Eigen::Vector3d::Constant(std::pow(problem_.filter.sigma_a_m_s2 * problem_.period_s, 2)),
      Eigen::Vector3d::Constant(std::pow(problem_.filter.sigma_alpha_rad_s2 * problem_.period_s, 2));
  WindowRows J = WindowRows::Zero();
  const Speeds first = speeds(state, k);
  if (k == 0) {
    Eigen::Vector<double, 6> told = Eigen::Vector<double, 6>::Zero(), variance;
    variance << Eigen::Vector3d::Constant(std::pow(problem_.sigma_speed_m_s, 2)),
        Eigen::Vector3d::Constant(std::pow(problem_.sigma_rate_rad_s, 2));
    if (problem_.start) {
      told << problem_.start->motion.velocity_in_world, problem_.start->motion.rate_in_cam;
      variance = problem_.start->cov.diagonal().tail<6>();
    }
    J.leftCols<6>() = first.J_from;
    J.middleCols<6>(6) = first.J_to;
    add_window(J, first.values - told, variance + walked_before(steps(0)) * step_variance, system);
  }
  if (k + 2 >= state.poses.size()) return;
  const Speeds second = speeds(state, k + 1);
  J.leftCols<6>() = -first.J_from;
  J.middleCols<6>(6) = second.J_from - first.J_to;
  J.rightCols<6>() = second.J_to;
  const double num_steps = walked_before(steps(k + 1)) + walked_after(steps(k));
  add_window(J, second.values - first.values, num_steps * step_variance, system);
}

void PathSmoother::add_start(const SmootherState& state, SmootherSystem& system) const {
  if (!problem_.start) return;
  const Rigid3 &told = problem_.start->motion.world_from_cam, &is = state.poses.front();
  const Eigen::Matrix<double, 6, 6> information = problem_.start->cov.topLeftCorner<6, 6>().inverse();
  const Eigen::Vector3d phi = log_so3(told.rotation.conjugate() * is.rotation);
  Eigen::Vector<double, 6> error;
  error << is.translation - told.translation, phi;
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
  J.bottomRightCorner<3, 3>() = inverse_right_jacobian(phi);
  system.chain.A.topLeftCorner<6, 6>() += J.transpose() * information * J;
  system.chain.a.head<6>() -= J.transpose() * information * error;
  system.cost += error.dot(information * error);
}

std::optional<SmootherSystem> PathSmoother::build(const SmootherState& state) const {
  SmootherSystem system{PoseChain(scale_at_ + 1)};
  add_told(state, system);
  add_start(state, system);
  std::vector<std::vector<std::size_t>> first_seen(state.poses.size());
  for (std::size_t i = 0; i < problem_.points.size(); ++i)
    if (problem_.points[i].range) first_seen[problem_.points[i].first_frame].push_back(i);
  std::size_t next = 0;
  for (std::size_t k = 0; k < state.poses.size(); ++k) {
    for (; next < sights_.size() && sights_[next].frame == k; ++next)
      if (!add_sight(state, sights_[next], system)) return std::nullopt;
    for (const std::size_t point : first_seen[k]) add_range(state, point, system);
    if (k + 1 < state.poses.size()) add_motion(state, k, system);
    if (!system.chain.eliminate()) return std::nullopt;
  }
  return system;
}

SmootherState PathSmoother::moved_by(const Eigen::VectorXd& border, std::span<const Eigen::Vector<double, 6>> poses,
                                     double share) const {
  SmootherState moved = state_;
  for (std::size_t k = 0; k < poses.size(); ++k) {
    moved.poses[k].translation += share * poses[k].head<3>();
    moved.poses[k].rotation = (moved.poses[k].rotation * exp_so3(share * poses[k].tail<3>())).normalized();
  }
  for (std::size_t i = 0; i < moved.points.size(); ++i)
    moved.points[i] += share * border.segment<3>(static_cast<Eigen::Index>(3 * i));
  Eigen::VectorXd lens = params(moved.camera.lens);
  for (int i = 0; i < num_estimated_; ++i)
    lens[lens_order_[static_cast<std::size_t>(i)]] += share * border[lens_at_ + i];
  moved.camera.lens = with_params(moved.camera.lens, lens);
  return moved;
}

/// Whole Gauss–Newton steps where the cost falls, else shorter ones.
bool PathSmoother::settle() {
  constexpr int most_iterations = 25;
  constexpr double settled = 1e-3, least_share = 0.02;  // of a step, squared, in σ
  auto system = build(state_);
  for (int iteration = 0; system && iteration < most_iterations; ++iteration) {
    const int num = num_solved();
    const Eigen::LLT<Eigen::MatrixXd> llt(system->chain.B.topLeftCorner(num, num));
    if (llt.info() != Eigen::Success) return false;
    Eigen::VectorXd border = Eigen::VectorXd::Zero(scale_at_ + 1);
    border.head(num) = llt.solve(system->chain.b.head(num));
    const double gain = system->chain.gain() + border.head(num).dot(system->chain.b.head(num));
    const auto poses = system->chain.steps(border);
    std::optional<SmootherSystem> next;
    double share = 1.0;
    for (; share > least_share && !next; share *= 0.5) {
      const SmootherState there = moved_by(border, poses, share);
      next = build(there);
      if (next && !(next->cost <= system->cost + 1e-9 * (1.0 + system->cost))) next.reset();
      if (next) state_ = there;
    }
    if (!next) return gain < settled * 100.0;
    system = std::move(next);
    if (gain < settled) return true;
  }
  return false;
}

std::size_t PathSmoother::drop_beyond_gate() {
  return std::erase_if(sights_, [&](const UsedSight& sight) {
    const std::size_t point = index_of_.at(sight.id);
    const auto px = project(state_.camera, state_.poses[sight.frame].inverse() * state_.points[point]);
    return !px || (*px - sight.px).squaredNorm() > problem_.filter.gate * sight.sigma_px * sight.sigma_px;
  });
}

std::optional<SmoothedPath> PathSmoother::solve() {
  std::erase_if(sights_, [&](const UsedSight& sight) {
    const auto point = index_of_.find(sight.id);
    return point == index_of_.end() ||
           !project(state_.camera, state_.poses[sight.frame].inverse() * state_.points[point->second]);
  });
  if (!settle()) return std::nullopt;
  const std::size_t num_dropped = drop_beyond_gate();
  if (num_dropped > 0 && !settle()) return std::nullopt;
  const auto system = build(state_);
  if (!system) return std::nullopt;
  SmoothedPath path = result(*system);
  path.num_dropped = num_dropped;
  return path;
}

void PathSmoother::fill_lens(const Eigen::MatrixXd& cov, SmoothedPath& path) const {
  path.camera = state_.camera;
  path.sigma_lens = cov.diagonal().segment(lens_at_, num_estimated_).cwiseSqrt();
  const Eigen::VectorXd now = params(state_.camera.lens);
  for (int i = 0; i < num_estimated_; ++i) {
    const auto at = static_cast<std::size_t>(i);
    const double told = problem_.filter.sigma_lens_params[at];
    path.lens_pull = std::max(path.lens_pull, std::abs(now[lens_order_[at]] - told_lens_[lens_order_[at]]) / told);
  }
}

void PathSmoother::fill_map(const Eigen::MatrixXd& cov, SmoothedPath& path) const {
  path.points = state_.points;
  for (std::size_t i = 0; i < state_.points.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(3 * i);
    path.point_covs.emplace_back(cov.block<3, 3>(at, at));
    path.ids.push_back(problem_.points[i].id);
  }
  for (const UsedSight& sight : sights_) {
    const auto px = project(state_.camera, state_.poses[sight.frame].inverse() * state_.points[index_of_.at(sight.id)]);
    if (px) path.residuals.push_back({sight.frame, sight.id, sight.px, sight.px - *px, sight.sigma_px});
  }
}

SmoothedPath PathSmoother::result(const SmootherSystem& system) const {
  const int num = num_solved(), all = scale_at_ + 1, rest = all - num;
  const Eigen::MatrixXd B = system.chain.B.selfadjointView<Eigen::Lower>();
  const Eigen::LLT<Eigen::MatrixXd> llt(B.topLeftCorner(num, num));
  const Eigen::MatrixXd considered = considered_cov();
  Eigen::MatrixXd J = Eigen::MatrixXd::Identity(all, rest);  // of the border, by what is given
  J.topRows(num) = -llt.solve(B.topRightCorner(num, rest));
  J.bottomRows(rest).setIdentity();
  Eigen::MatrixXd cov = J * considered * J.transpose();
  cov.topLeftCorner(num, num) += llt.solve(Eigen::MatrixXd::Identity(num, num));
  PoseChain::Spread spread = system.chain.spread(cov, J);
  SmoothedPath path;
  path.world_from_cam = state_.poses;
  for (std::size_t k = 0; k < state_.poses.size(); ++k) {
    Eigen::Matrix<double, 6, 6> to_camera = Eigen::Matrix<double, 6, 6>::Identity();
    to_camera.topLeftCorner<3, 3>() = state_.poses[k].rotation.toRotationMatrix().transpose();
    path.cov.push_back(to_camera * spread.cov[k] * to_camera.transpose());
    spread.J[k] = to_camera * spread.J[k];
  }
  fill_map(cov, path);
  fill_lens(cov, path);
  const Eigen::MatrixXd S = B.bottomRightCorner(rest, rest) + B.bottomLeftCorner(rest, num) * J.topRows(num);
  const std::vector<int> given(lens_order_.begin() + num_estimated_, lens_order_.end());
  path.given = given_numbers({problem_.camera, given, considered, system.chain.b.tail(rest), S, spread.J, path.cov});
  return path;
}

}  // namespace

std::optional<SmoothedPath> smoothed_path(const SmootherProblem& problem) {
  if (problem.world_from_cam.size() < 3 || problem.points.empty()) return std::nullopt;
  return PathSmoother(problem).solve();
}

}  // namespace alidade
