#include <algorithm>
#include <cmath>
#include <span>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/imu/imu_alignment.h"
#include "alidade/localize/path/path_system.h"

// Factors of an IMU: angular rates between two frames and specific forces between three, in place of random
// accelerations; and the priors of its own parameters, which come first of all shared ones.

namespace alidade {
namespace {

constexpr double middle_of_three = 2.366;  // median of χ² with three degrees of freedom

double square_of(double value) { return value * value; }

/// σ of the readings' white noise over the given one, at least 1, from second differences: a path of few frames absorbs
/// noise and shows little of it. 1 if the differences do not look white, as with vibration or a filter.
double noise_factor(std::span<const ImuReading> readings, Eigen::Vector3d ImuReading::*of, double density) {
  constexpr std::size_t min_readings = 100;
  if (readings.size() < min_readings) return 1.0;
  std::vector<double> periods_s, sizes;
  double square = 0.0, next = 0.0, after = 0.0;
  Eigen::Vector3d before = Eigen::Vector3d::Zero(), before_that = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i + 2 < readings.size(); ++i) {
    const Eigen::Vector3d second = readings[i].*of - 2.0 * (readings[i + 1].*of) + readings[i + 2].*of;
    periods_s.push_back(readings[i + 1].t_s - readings[i].t_s);
    for (const double each : second) sizes.push_back(std::abs(each));
    square += second.squaredNorm();
    next += second.dot(before);
    after += second.dot(before_that);
    before_that = before;
    before = second;
  }
  // autocorrelation of white noise after second differences: −4/6 and 1/6
  const bool is_white = std::abs(next / square + 4.0 / 6.0) < 0.06 && std::abs(after / square - 1.0 / 6.0) < 0.08;
  if (!is_white) return 1.0;
  constexpr double median_of_normal = 0.6745, of_second_difference = 6.0;
  const double sigma = median_of(std::move(sizes)) / (median_of_normal * std::sqrt(of_second_difference));
  const double ratio = sigma * std::sqrt(median_of(std::move(periods_s))) / density;
  constexpr double same = 1.2;
  return std::isfinite(ratio) && ratio > same ? ratio : 1.0;
}

/// Changes of one sensor's biases from node to node, from the prior of their random walk and the readings.
struct Walked {
  Eigen::VectorXd by;   ///< Over σ of the walk,
  Eigen::MatrixXd cov;  ///< and its posterior covariance, in the same unit.
};

/// Maximum likelihood factor on the variance of the walk, and the decrease of −2 ln likelihood by it:
/// along each eigenvector of the covariance K, the readings alone give y = u/(1 − k) with variance k/(1 −
/// k).
struct LargerWalk {
  double factor = 1.0, gain = 0.0;
};
LargerWalk larger_walk(const Walked& walked) {
  const SymmetricEigen of = symmetric_eigen(walked.cov);
  const Eigen::VectorXd along = of.vectors.transpose() * walked.by;
  const auto cost_of = [&](double factor) {
    constexpr double hardly = 1e-6;
    double cost = 0.0;
    for (Eigen::Index i = 0; i < along.size(); ++i) {
      const double k = std::clamp(of.values[i], hardly, 1.0 - hardly);
      const double variance = k / (1.0 - k) + factor;
      cost += square_of(along[i] / (1.0 - k)) / variance + std::log(variance);
    }
    return cost;
  };
  constexpr double ratio = 1.2, most = 1e7;
  const double given = cost_of(1.0);
  LargerWalk best;
  for (double factor = ratio; factor < most; factor *= ratio)
    if (const double gained = given - cost_of(factor); gained > best.gain) best = {factor, gained};
  return best;
}

}  // namespace

/// Preintegrates the steps between frames for which there are readings, at the initial biases.
void PathSmoother::begin_imu() {
  if (!problem_.imu) return;
  const SmootherImu& imu = *problem_.imu;
  state_.imu = imu.start;
  const double max_gap_s = max_imu_gap_s(imu.readings);
  const auto is_jump = [&](std::size_t k) { return k < problem_.is_jump.size() && problem_.is_jump[k]; };
  const std::size_t num = problem_.t_s.size();
  for (std::size_t k = 0; k + 1 < num; ++k) {
    const double from_s = problem_.t_s[k], to_s = problem_.t_s[k + 1], mid_s = 0.5 * (from_s + to_s);
    const ImuState::Bias bias = imu.start.bias_at(mid_s);
    const auto step = preintegrated(imu.readings, from_s, to_s, max_gap_s, bias.rate, bias.force);
    steps_.push_back(step && !is_jump(k + 1) ? std::optional(ImuStepAt{*step, mid_s, bias.rate, bias.force})
                                             : std::nullopt);
    rates_used_.push_back(steps_.back().has_value());
  }
  for (std::size_t k = 0; k + 2 < num; ++k) forces_used_.push_back(steps_[k] && steps_[k + 1]);
  rate_noise_ = rate_noise_floor_ =
      square_of(noise_factor(imu.readings, &ImuReading::rate_rad_s, imu.noise.rate_density));
  force_noise_ = force_noise_floor_ =
      square_of(noise_factor(imu.readings, &ImuReading::force_m_s2, imu.noise.force_density));
  leave_out_blows();
}

/// Rejects steps that are far from the initial guess compared with the others: an IMU step is more certain than the
/// observations of a frame, and a shock would bend the path before it is recognised.
void PathSmoother::leave_out_blows() {
  constexpr double far = 6.0;
  const auto leave_out = [&](std::vector<bool>& used, const auto& error_of) {
    std::vector<double> sizes, all;
    for (std::size_t k = 0; k < used.size(); ++k) {
      sizes.push_back(used[k] ? error_of(k).norm() : 0.0);
      if (used[k]) all.push_back(sizes.back());
    }
    if (all.empty()) return;
    const double limit = far * median_of(std::move(all));
    for (std::size_t k = 0; k < used.size(); ++k) used[k] = used[k] && sizes[k] <= limit;
  };
  leave_out(rates_used_, [&](std::size_t k) { return Eigen::Vector3d(rates_at(state_, k).error); });
  leave_out(forces_used_, [&](std::size_t k) { return Eigen::Vector3d(forces_at(state_, k).error); });
}

ImuRows PathSmoother::rates_at(const SmootherState& state, std::size_t k) const {
  return rotation_rows(*steps_[k], std::span<const Rigid3, 2>(state.poses.data() + k, 2), state.imu);
}

ImuRows PathSmoother::forces_at(const SmootherState& state, std::size_t k) const {
  return force_rows(*steps_[k], *steps_[k + 1], std::span<const Rigid3, 3>(state.poses.data() + k, 3), state.imu);
}

double PathSmoother::rates_variance(std::size_t k) const {
  return rotation_variance(steps_[k]->step, problem_.imu->noise);
}

double PathSmoother::forces_variance(std::size_t k) const {
  return force_variance(steps_[k]->step, steps_[k + 1]->step, problem_.imu->noise);
}

void PathSmoother::add_imu(const SmootherState& state, std::size_t k, SmootherSystem& system) const {
  const auto add = [&](const ImuRows& rows, double variance) {
    PoseChain& chain = system.chain;
    const double weight = 1.0 / variance;
    chain.A += weight * rows.J_poses.transpose() * rows.J_poses;
    chain.a -= weight * rows.J_poses.transpose() * rows.error;
    chain.U.leftCols(lens_at_) += weight * rows.J_poses.transpose() * rows.J_imu;
    chain.B.topLeftCorner(lens_at_, lens_at_) += weight * rows.J_imu.transpose() * rows.J_imu;
    chain.b.head(lens_at_) -= weight * rows.J_imu.transpose() * rows.error;
    system.cost += weight * rows.error.squaredNorm();
  };
  if (uses_rates(k)) add(rates_at(state, k), rate_noise_ * rates_variance(k));
  if (uses_forces(k)) add(forces_at(state, k), force_noise_ * forces_variance(k));
}

/// Prior of the errors of the axes, isotropic: off the diagonal a symmetric part has σ smaller by √2. The trace of the
/// force axes is the force scale, and is not estimated twice.
void PathSmoother::add_given_axes(const ImuState& is, double sigma, PoseChain& chain, double& cost) {
  const auto add = [&](int at, double error, double weight) {
    chain.B(at, at) += weight;
    chain.b[at] -= weight * error;
    cost += weight * error * error;
  };
  const double weight = 1.0 / (sigma * sigma), no_trace = 1e4 * weight, trace = is.force_axes.trace();
  for (int i = 0; i < 9; ++i) add(is.force_axes_at() + i, is.force_axes(i / 3, i % 3), weight);
  for (int i = 0; i < 3; ++i) {
    add(is.rate_axes_at() + i, is.rate_axes(i, i), weight);
    add(is.rate_axes_at() + 3 + i, is.rate_axes((i + 1) % 3, (i + 2) % 3), 2.0 * weight);
    chain.b[is.force_axes_at() + 4 * i] -= no_trace * trace;
    for (int j = 0; j < 3; ++j) chain.B(is.force_axes_at() + 4 * i, is.force_axes_at() + 4 * j) += no_trace;
  }
  cost += no_trace * trace * trace;
}

/// Priors of the IMU: magnitudes of its biases and of gravity, bias walks, mounting, clock.
void PathSmoother::add_given_imu(const SmootherState& state, SmootherSystem& system) const {
  if (!problem_.imu) return;
  const SmootherImu& given = *problem_.imu;
  const ImuState& is = state.imu;
  PoseChain& chain = system.chain;
  const auto add = [&](int at, const Eigen::Vector3d& error, double sigma, int minus = -1) {
    const double weight = 1.0 / (sigma * sigma);
    chain.B.diagonal().segment<3>(at).array() += weight;
    chain.b.segment<3>(at) -= weight * error;
    system.cost += weight * error.squaredNorm();
    if (minus < 0) return;
    chain.B.diagonal().segment<3>(minus).array() += weight;
    chain.B.block<3, 3>(at, minus).diagonal().array() -= weight;
    chain.B.block<3, 3>(minus, at).diagonal().array() -= weight;
    chain.b.segment<3>(minus) += weight * error;
  };
  const auto add_one = [&](int at, double error, double sigma) {
    chain.B(at, at) += 1.0 / (sigma * sigma);
    chain.b[at] -= error / (sigma * sigma);
    system.cost += error * error / (sigma * sigma);
  };
  add(0, is.rate_bias[0], given.noise.sigma_rate_bias);
  add(3, is.force_bias[0], given.noise.sigma_force_bias);
  for (std::size_t i = 1; i < is.node_t_s.size(); ++i) {
    const double root_s = std::sqrt(is.node_t_s[i] - is.node_t_s[i - 1]);
    const int at = 6 * static_cast<int>(i);
    add(at, is.rate_bias[i] - is.rate_bias[i - 1], given.noise.rate_walk * std::sqrt(rate_walk_) * root_s, at - 6);
    add(at + 3, is.force_bias[i] - is.force_bias[i - 1], given.noise.force_walk * std::sqrt(force_walk_) * root_s,
        at - 3);
  }
  add(is.turn_at(), log_so3(is.turn), given.sigma_rotation_rad);
  add(is.place_at(), is.imu_in_cam - given.start.imu_in_cam, given.sigma_position_m);
  add_one(is.late_at(), is.late_s, given.sigma_late_s);
  add_one(is.clock_rate_at(), is.clock_rate, given.sigma_clock_rate * std::sqrt(clock_rate_));
  add_one(is.scale_at(), is.force_scale, given.noise.sigma_force_scale);
  add_given_axes(is, given.noise.sigma_axes, chain, system.cost);
  const double size = is.gravity_in_world.norm(), weight = std::pow(given.sigma_gravity_m_s2, -2);
  const double error = size - given.gravity_m_s2;
  const Eigen::Vector3d along = is.gravity_in_world / size;
  chain.B.block<3, 3>(is.gravity_at(), is.gravity_at()) += weight * along * along.transpose();
  chain.b.segment<3>(is.gravity_at()) -= weight * error * along;
  system.cost += weight * error * error;
}

/// Where residuals exceed the given noise, σ is enlarged by their median; a step far beyond that, such as a shock, is
/// rejected. Returns whether any of this changed.
bool PathSmoother::choose_steps() {
  if (!problem_.imu) return false;
  constexpr double gate = 21.1;  // χ² with three degrees of freedom: 99.99 %
  bool is_other = false;
  const auto choose = [&](std::size_t num, const auto& has, const auto& chi2_of, double& noise, double floor,
                          std::vector<bool>& used) {
    std::vector<double> all;
    for (std::size_t k = 0; k < num; ++k)
      if (has(k)) all.push_back(chi2_of(k));
    if (all.empty()) return;
    const double larger = std::max(floor, median_of(all) / middle_of_three);
    constexpr double same = 1.1;
    is_other = is_other || larger > same * noise || noise > same * larger;
    noise = larger;
    std::size_t next = 0;
    for (std::size_t k = 0; k < num; ++k) {
      if (!has(k)) continue;
      const bool fits = all[next++] <= gate * noise;
      is_other = is_other || fits != used[k];
      used[k] = fits;
    }
  };
  choose(
      rates_used_.size(), [&](std::size_t k) { return steps_[k].has_value(); },
      [&](std::size_t k) { return rates_at(state_, k).error.squaredNorm() / rates_variance(k); }, rate_noise_,
      rate_noise_floor_, rates_used_);
  choose(
      forces_used_.size(), [&](std::size_t k) { return steps_[k] && steps_[k + 1]; },
      [&](std::size_t k) { return forces_at(state_, k).error.squaredNorm() / forces_variance(k); }, force_noise_,
      force_noise_floor_, forces_used_);
  return is_other;
}

/// Where the biases change by more than the given random walk allows, it is enlarged to its maximum likelihood: a
/// sensor that warms up would bend the path. The prior σ of the clock's rate likewise.
bool PathSmoother::choose_walks() {
  if (!problem_.imu) return false;
  const auto system = build(state_, Shared::solved);
  if (!system) return false;
  const int num = num_solved();
  const Llt llt(system->chain.B.topLeftCorner(num, num));
  if (!llt.is_positive()) return false;
  const Eigen::MatrixXd cov = llt.inverse().topLeftCorner(lens_at_, lens_at_);
  const ImuState& is = state_.imu;
  const auto num_spans = static_cast<Eigen::Index>(is.node_t_s.size()) - 1;
  bool is_other = false;
  const auto choose = [&](const std::vector<Eigen::Vector3d>& bias, Eigen::Index at, double density, double& walk) {
    constexpr double clear = 16.0;  // 4σ
    Eigen::MatrixXd spans = Eigen::MatrixXd::Zero(3 * num_spans, lens_at_);
    Eigen::VectorXd by(3 * num_spans);
    for (Eigen::Index i = 0; i < num_spans; ++i) {
      const auto k = static_cast<std::size_t>(i);
      const double sigma = density * std::sqrt(walk * (is.node_t_s[k + 1] - is.node_t_s[k]));
      spans.block<3, 3>(3 * i, 6 * i + at) = -Eigen::Matrix3d::Identity() / sigma;
      spans.block<3, 3>(3 * i, 6 * i + 6 + at) = Eigen::Matrix3d::Identity() / sigma;
      by.segment<3>(3 * i) = (bias[k + 1] - bias[k]) / sigma;
    }
    const LargerWalk larger = larger_walk({by, spans * cov * spans.transpose()});
    if (!(larger.gain > clear)) return;
    walk *= larger.factor;
    is_other = true;
  };
  constexpr double contradicted = 9.0;  // 3σ
  if (const double rate = square_of(is.clock_rate / problem_.imu->sigma_clock_rate);
      rate > contradicted * clock_rate_) {
    clock_rate_ = rate;
    is_other = true;
  }
  choose(is.rate_bias, 0, problem_.imu->noise.rate_walk, rate_walk_);
  choose(is.force_bias, 3, problem_.imu->noise.force_walk, force_walk_);
  return is_other;
}

/// σ of the logarithm of the path's extent: that of its scale, if nothing else changes the extent.
void PathSmoother::fill_imu(const SmootherSystem& system, const Eigen::MatrixXd& cov, const Asked& asked,
                            SmoothedPath& path) const {
  if (!problem_.imu) return;
  SmoothedImu imu{.state = state_.imu, .sigma = cov.diagonal().head(lens_at_).cwiseSqrt()};
  imu.rate_noise_factor = std::sqrt(rate_noise_);
  imu.force_noise_factor = std::sqrt(force_noise_);
  imu.rate_walk_factor = std::sqrt(rate_walk_);
  imu.force_walk_factor = std::sqrt(force_walk_);
  for (std::size_t k = 0; k < rates_used_.size(); ++k) {
    imu.num_missing += steps_[k] ? 0 : 1;
    const bool is_used = uses_rates(k) && (uses_forces(k) || k >= forces_used_.size());
    imu.num_steps += is_used ? 1 : 0;
    imu.num_rejected += steps_[k] && !is_used && (k + 1 >= steps_.size() || steps_[k + 1]) ? 1 : 0;
  }
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const Rigid3& pose : state_.poses) centre += pose.translation / static_cast<double>(state_.poses.size());
  double extent2 = 0.0;
  for (const Rigid3& pose : state_.poses) extent2 += (pose.translation - centre).squaredNorm();
  std::vector<Eigen::MatrixXd> W;
  for (const Rigid3& pose : state_.poses) {
    W.emplace_back(Eigen::MatrixXd::Zero(6, 1));
    if (extent2 > 0.0) W.back().topRows<3>() = (pose.translation - centre) / extent2;
  }
  const PoseChain::Columns Z = system.chain.solve({W, {}}, num_solved());
  double variance = 0.0;
  for (std::size_t k = 0; k < W.size(); ++k) variance += W[k].col(0).dot(Z.poses[k].col(0));
  imu.sigma_scale = std::sqrt(std::max(variance, 0.0));
  const Eigen::Index at = static_cast<Eigen::Index>(lens_order_.size()) - num_estimated_ + scale_cause;
  const double information = asked.information(at, at);
  if (information > 0.0) {
    imu.target_scale = asked.score[at] / information;
    imu.sigma_target = 1.0 / std::sqrt(information);
  }
  path.imu = std::move(imu);
}

}  // namespace alidade
