#include <Eigen/LU>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/path_system.h"

// Factors of the path's cost other than observations (path_observations.cpp): known points, distance priors, motion,
// start.

namespace alidade {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using WindowRows = PathSmoother::WindowRows;

constexpr double hardly_given = 1e-6;  // m⁻², rad⁻²: a single undetermined pose must not stop the solution

void add_window(const WindowRows& J, const Eigen::Vector<double, 6>& error, const Eigen::Vector<double, 6>& variance,
                SmootherSystem& system) {
  const WindowRows weighted = variance.cwiseInverse().asDiagonal() * J;
  system.chain.A += J.transpose() * weighted;
  system.chain.a -= weighted.transpose() * error;
  system.cost += error.cwiseAbs2().cwiseQuotient(variance).sum();
}

Eigen::Matrix3d inverse_right_jacobian(const Eigen::Vector3d& phi) { return right_jacobian(phi).inverse(); }

/// Variance of the mean velocity over `n` steps of a random walk with unit steps, and of its part left to the end.
double walked_before(double n) { return (n + 1.0) * (2.0 * n + 1.0) / (6.0 * n); }
double walked_after(double n) { return (n - 1.0) * (2.0 * n - 1.0) / (6.0 * n); }

}  // namespace

/// Prior information of the estimated part of the lens: from its covariance in the camera file, else the filter's σ.
Eigen::MatrixXd PathSmoother::lens_information() const {
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num_estimated_, num_estimated_);
  const bool has_cov = problem_.camera.cov.size() > 0 && !is_lens_freed_;
  for (int i = 0; i < num_estimated_; ++i) {
    const double sigma = sigma_estimated_[static_cast<std::size_t>(i)];
    for (int j = 0; has_cov && j < num_estimated_; ++j)
      cov(i, j) =
          problem_.camera.cov(lens_order_[static_cast<std::size_t>(i)], lens_order_[static_cast<std::size_t>(j)]);
    if (!(cov(i, i) > 0.0)) cov(i, i) = sigma * sigma;
  }
  return inverse_symmetric(cov);
}

/// Covariance of the consider parameters: the rest of the lens, the target's scale; the other causes are assumed zero.
Eigen::MatrixXd PathSmoother::considered_cov() const {
  const int num_rest = static_cast<int>(lens_order_.size()) - num_estimated_;
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(num_rest + num_causes, num_rest + num_causes);
  cov(num_rest + scale_cause, num_rest + scale_cause) = problem_.sigma_scale * problem_.sigma_scale;
  if (problem_.camera.cov.size() == 0) return cov;
  const auto at = [&](int i) { return lens_order_[static_cast<std::size_t>(num_estimated_ + i)]; };
  for (int i = 0; i < num_rest; ++i)
    for (int j = 0; j < num_rest; ++j) cov(i, j) = problem_.camera.cov(at(i), at(j));
  return cov;
}

/// Derivative of a given position with respect to the shape of the target: relatively longer along x than given, and
/// shorter along y by the same ratio.
Eigen::Vector3d PathSmoother::shape_change(const Eigen::Vector3d& given_in_world) const {
  const Eigen::Vector3d out = given_in_world - target_centre_;
  return {0.5 * out.x(), -0.5 * out.y(), 0.0};
}

void PathSmoother::add_given_point(const SmootherState& state, std::size_t point, SmootherSystem& system) const {
  const Eigen::Vector3d& given = *problem_.points[point].given_in_world;
  const double weight = std::pow(problem_.points[point].sigma_m, -2);
  const Eigen::Vector3d error = state.points[point] - given;
  Eigen::Matrix<double, 3, 2> J;  // derivative of the given position w.r.t. scale and shape
  J << given, shape_change(given);
  PoseChain& chain = system.chain;
  const int at = chain.place_of(point), by = causes_at_ + scale_cause;
  chain.B.diagonal().segment<3>(at).array() += weight;
  chain.b.segment<3>(at) -= weight * error;
  system.cost += weight * error.squaredNorm();
  if (!system.has_given) return;
  chain.B.block<3, 2>(at, by) -= weight * J;
  chain.B.block<2, 2>(by, by) += weight * J.transpose() * J;
  chain.b.segment<2>(by) += weight * J.transpose() * error;
}

/// Prior of the lens.
void PathSmoother::add_given_lens(const SmootherState& state, SmootherSystem& system) const {
  PoseChain& chain = system.chain;
  if (num_estimated_ == 0) return;
  const Eigen::MatrixXd information = lens_information();
  const Eigen::VectorXd now = params(state.camera.lens);
  Eigen::VectorXd error(num_estimated_);
  for (int i = 0; i < num_estimated_; ++i) {
    const int at = lens_order_[static_cast<std::size_t>(i)];
    error[i] = now[at] - given_lens_[at];
  }
  chain.B.block(lens_at_, lens_at_, num_estimated_, num_estimated_) += information;
  chain.b.segment(lens_at_, num_estimated_) -= information * error;
  system.cost += error.dot(information * error);
}

PathSmoother::Twist PathSmoother::twist_at(const SmootherState& state, std::size_t k) const {
  const std::size_t from = k > 0 ? k - 1 : 0, to = std::min(k + 1, state.poses.size() - 1);
  const double dt_s = problem_.t_s[to] - problem_.t_s[from];
  if (!(dt_s > 0.0)) return Twist::Zero();
  Twist twist;
  twist << (state.poses[to].translation - state.poses[from].translation) / dt_s,
      log_so3(state.poses[from].rotation.conjugate() * state.poses[to].rotation) / dt_s;
  return twist;
}

/// Prior of a point's distance from the camera that first observed it, in inverse distance.
void PathSmoother::add_range(const SmootherState& state, std::size_t point, SmootherSystem& system) const {
  const SmootherPoint& given = problem_.points[point];
  const Eigen::Vector3d from_camera = state.points[point] - state.poses[given.first_frame].translation;
  const double distance_m = from_camera.norm(), weight = given.range->range_m / given.range->sigma_rel;
  const double error = weight * (1.0 / distance_m - 1.0 / given.range->range_m);
  const Eigen::Vector3d J =
      -weight / std::pow(distance_m, 3) * from_camera;  // w.r.t. the point; w.r.t. the position, minus that
  PoseChain& chain = system.chain;
  const int at = chain.place_of(point);
  chain.A.topLeftCorner<3, 3>() += J * J.transpose();
  chain.U.block<3, 3>(0, at) -= J * J.transpose();
  chain.B.block<3, 3>(at, at) += J * J.transpose();
  chain.a.head<3>() += J * error;
  chain.b.segment<3>(at) -= J * error;
  system.cost += error * error;
}

/// Velocity and angular rate between frame i and the next.
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

/// Size of the surroundings of frame k relative to the initial guess, with its derivatives with respect to the position
/// and each point there. Points are weighted by 1/d², as their parallax is: one with an uncertain distance is not
/// affected.
PathSmoother::Surroundings PathSmoother::surroundings(const SmootherState& state, std::size_t k,
                                                      const PoseChain& chain) const {
  constexpr double nearest = 1e-6;
  Surroundings out{1.0, Eigen::Vector3d::Zero(), Eigen::VectorXd::Zero(chain.b.size()),
                   state.poses[k].rotation.toRotationMatrix()};
  double sum = 0.0, sum_begun = 0.0;
  for (const std::size_t point : there_[k]) {
    const Eigen::Vector3d away = state.points[point] - state.poses[k].translation;
    const double d2 = std::max(away.squaredNorm(), nearest);
    sum += 1.0 / d2;
    sum_begun +=
        1.0 / std::max((problem_.points[point].point_in_world - problem_.world_from_cam[k].translation).squaredNorm(),
                       nearest);
    out.by_border.segment<3>(chain.place_of(point)) = away / (d2 * d2);
  }
  if (!(sum > 0.0)) return out;
  out.size = std::sqrt(sum_begun / sum);
  out.by_border /= sum;
  for (const std::size_t point : there_[k]) out.by_position -= out.by_border.segment<3>(chain.place_of(point));
  return out;
}

/// Factor for a change of velocity, in the camera's frame and in the unit given by the surroundings: invariant to a
/// rotation, translation or scaling of the world, as are its derivatives. J: of the change itself, in the world frame.
void PathSmoother::add_acceleration(const Surroundings& around, const WindowRows& J, Eigen::Vector<double, 6> error,
                                    const Eigen::Vector<double, 6>& variance, SmootherSystem& system) const {
  WindowRows scaled = J;
  scaled.topRows<3>() /= around.size;
  error.head<3>() /= around.size;
  scaled.block<3, 3>(0, 3) += cross_matrix(error.head<3>()) * around.world_from_cam;
  add_window(scaled, error, variance, system);
  const Eigen::Vector3d weighted = error.head<3>().cwiseQuotient(variance.head<3>());
  const double squares = weighted.dot(error.head<3>());
  const Eigen::Vector<double, PoseChain::window> pull = scaled.topRows<3>().transpose() * weighted;
  PoseChain& chain = system.chain;
  chain.A.leftCols<3>() -= pull * around.by_position.transpose();
  chain.A.topRows<3>() -= around.by_position * pull.transpose();
  chain.A.topLeftCorner<3, 3>() += squares * around.by_position * around.by_position.transpose();
  chain.U -= pull * around.by_border.transpose();
  chain.U.topRows<3>() += squares * around.by_position * around.by_border.transpose();
  chain.add_square(around.by_border, squares);
  chain.a.head<3>() += squares * around.by_position;
  chain.b += squares * around.by_border;
}

/// Number of changes of the random acceleration between frame k and the next.
double PathSmoother::num_steps(std::size_t k) const {
  return std::max(1.0, std::round((problem_.t_s[k + 1] - problem_.t_s[k]) / problem_.period_s));
}

/// Variance of the change of velocity and rate by one of these.
Eigen::Vector<double, 6> PathSmoother::step_variance() const {
  Eigen::Vector<double, 6> variance;
  variance << Eigen::Vector3d::Constant(std::pow(problem_.filter.sigma_a_m_s2 * problem_.period_s, 2)),
      Eigen::Vector3d::Constant(std::pow(problem_.filter.sigma_alpha_rad_s2 * problem_.period_s, 2));
  return variance;
}

/// Prior of the first velocities.
void PathSmoother::add_first_speeds(const Speeds& first, std::size_t k, SmootherSystem& system) const {
  Eigen::Vector<double, 6> given = Eigen::Vector<double, 6>::Zero(), variance;
  variance << Eigen::Vector3d::Constant(std::pow(problem_.sigma_speed_m_s, 2)),
      Eigen::Vector3d::Constant(std::pow(problem_.sigma_rate_rad_s, 2));
  if (problem_.start && k == 0) {
    given << problem_.start->motion.velocity_in_world, problem_.start->motion.rate_in_cam;
    variance = problem_.start->cov.diagonal().tail<6>();
  }
  constexpr double any_m_s = 5.0;  // an IMU's path is in metres, but the velocity prior is not
  if (problem_.imu) variance.head<3>().array() += any_m_s * any_m_s;
  WindowRows J = WindowRows::Zero();
  J.leftCols<6>() = first.J_from;
  J.middleCols<6>(6) = first.J_to;
  add_window(J, first.values - given, variance + walked_before(num_steps(k)) * step_variance(), system);
}

/// White-acceleration model: velocity and rate from frame k to the next, and from there to the one after it, differ by
/// random accelerations. Across a jump there is no factor, and velocities start again after it.
void PathSmoother::add_motion(const SmootherState& state, std::size_t k, SmootherSystem& system) const {
  const auto is_jump = [&](std::size_t i) { return i < problem_.is_jump.size() && problem_.is_jump[i]; };
  if (is_jump(k) || is_jump(k + 1)) system.chain.A.diagonal().head<6>().array() += hardly_given;
  if (is_jump(k + 1)) return;
  const Speeds first = speeds(state, k);
  if (k == 0 || is_jump(k)) add_first_speeds(first, k, system);
  if (k + 2 >= state.poses.size() || is_jump(k + 2)) return;
  const Speeds second = speeds(state, k + 1);
  WindowRows J;
  J.leftCols<6>() = -first.J_from;
  J.middleCols<6>(6) = second.J_from - first.J_to;
  J.rightCols<6>() = second.J_to;
  const double num_drawn = walked_before(num_steps(k + 1)) + walked_after(num_steps(k));
  Eigen::Vector<double, 6> change = second.values - first.values;
  const auto is_measured = [&](Eigen::Index row) {
    J.middleRows<3>(row).setZero();
    change.segment<3>(row).setZero();
  };
  if (uses_forces(k)) is_measured(0);
  if (uses_rates(k) && uses_rates(k + 1)) is_measured(3);
  add_acceleration(surroundings(state, k, system.chain), J, change, num_drawn * step_variance(), system);
}

/// Adds the motion; if given numbers are to be tested, records its gradient by pose and point.
void PathSmoother::add_motion_and_pull(const SmootherState& state, std::size_t k, SmootherSystem& system) const {
  const PoseChain& chain = system.chain;
  if (!system.has_given) return add_motion(state, k, system);
  const Eigen::Vector<double, PoseChain::window> a = chain.a;
  const Eigen::VectorXd b = chain.b;
  add_motion(state, k, system);
  PoseChain::Steps& pull = system.motion_pull;
  for (std::size_t i = 0; i < 3 && k + i < pull.poses.size(); ++i)
    pull.poses[k + i] += (chain.a - a).segment<6>(6 * static_cast<Eigen::Index>(i));
  for (const std::size_t point : there_[k]) pull.points[point] += (chain.b - b).segment<3>(chain.place_of(point));
}

void PathSmoother::add_start(const SmootherState& state, SmootherSystem& system) const {
  if (!problem_.start) return;
  const Rigid3 &given = problem_.start->motion.world_from_cam, &is = state.poses.front();
  const Eigen::Matrix<double, 6, 6> information = inverse_symmetric(problem_.start->cov.topLeftCorner<6, 6>());
  const Eigen::Vector3d phi = log_so3(given.rotation.conjugate() * is.rotation);
  Eigen::Vector<double, 6> error;
  error << is.translation - given.translation, phi;
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Identity();
  J.bottomRightCorner<3, 3>() = inverse_right_jacobian(phi);
  system.chain.A.topLeftCorner<6, 6>() += J.transpose() * information * J;
  system.chain.a.head<6>() -= J.transpose() * information * error;
  system.cost += error.dot(information * error);
}

/// Damping: the steps of a frame's pose, and of the points that enter with it, are zero with σ a share of the distances
/// there (K. Levenberg 1944, D. W. Marquardt 1963, in units of the scene).
void PathSmoother::keep_steps_short(const SmootherState& state, std::size_t k, SmootherSystem& system) const {
  if (!(step_share_ > 0.0) || there_[k].empty()) return;
  double sum = 0.0;
  const auto distance_to = [&](std::size_t point) {
    constexpr double nearest = 1e-9;
    return std::max((state.points[point] - state.poses[k].translation).norm(), nearest);
  };
  for (const std::size_t point : there_[k]) sum += 1.0 / distance_to(point);
  const double distance = static_cast<double>(there_[k].size()) / sum;
  system.chain.A.diagonal().head<3>().array() += std::pow(step_share_ * distance, -2);
  system.chain.A.diagonal().segment<3>(3).array() += std::pow(step_share_, -2);
  for (const std::size_t point : entering_[k])
    system.chain.B.diagonal().segment<3>(system.chain.place_of(point)).array() +=
        std::pow(step_share_ * distance_to(point), -2);
}

/// Empty also if the cost exceeds `most`, where the rest is not needed, and if a point is not determined; then `vague`
/// is its index.
std::optional<SmootherSystem> PathSmoother::build(const SmootherState& state, Shared shared, double most,
                                                  std::optional<std::size_t>* vague) const {
  SmootherSystem system{PoseChain(shared == Shared::all ? causes_at_ + num_causes : num_solved(), max_at_once_)};
  system.has_given = shared == Shared::all;
  if (system.has_given)
    system.motion_pull = {std::vector<Eigen::Vector<double, 6>>(state.poses.size(), Eigen::Vector<double, 6>::Zero()),
                          std::vector<Eigen::Vector3d>(state.points.size(), Eigen::Vector3d::Zero())};
  add_given_lens(state, system);
  add_given_imu(state, system);
  add_start(state, system);
  std::vector<std::vector<std::size_t>> first_seen(state.poses.size());
  for (std::size_t i = 0; i < problem_.points.size(); ++i)
    if (problem_.points[i].range && lives_[i]) first_seen[problem_.points[i].first_frame].push_back(i);
  Lookahead rows;
  for (std::size_t k = 0; k < state.poses.size(); ++k) {
    for (const std::size_t point : entering_[k]) {
      (void)system.chain.enter(point);
      if (problem_.points[point].given_in_world) add_given_point(state, point, system);
    }
    if (!add_observations(state, k, rows, system)) return std::nullopt;
    for (const std::size_t point : first_seen[k]) add_range(state, point, system);
    if (k + 1 < state.poses.size()) add_motion_and_pull(state, k, system);
    add_imu(state, k, system);
    if (k + 1 == state.poses.size()) system.chain.A.diagonal().head<6>().array() += hardly_given;
    if (fixed_ && fixed_->frame == k) add_fixed(state, system);
    keep_steps_short(state, k, system);
    if (!(system.cost <= most) || !system.chain.eliminate()) return std::nullopt;
    for (const std::size_t point : leaving_[k])
      if (!system.chain.leave(point)) {
        if (vague != nullptr) *vague = point;
        return std::nullopt;
      }
  }
  return system;
}

}  // namespace alidade
