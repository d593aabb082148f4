#include "alidade/track/checks/path_equations.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/estimation/motion_models.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/track/observation_model.h"

namespace alidade {
namespace {

using Six = Eigen::Matrix<double, 6, 6>;
using PathState = TargetPath::value_type;

/// First column of each head's parameters, and their total number.
struct Columns {
  std::vector<Eigen::Index> first;
  Eigen::Index num = 0;

  explicit Columns(std::span<const RigHead> heads) {
    for (const RigHead& head : heads) {
      first.push_back(num);
      num += num_head_params + params(head.camera.lens).size() + 1;
    }
  }
};

/// The normal equations of one instant: its state, its coupling to the instant before, and the
/// right-hand sides: that of the residuals, then one per parameter (none if only the path is estimated).
struct Instant {
  Six A = Six::Zero(), before = Six::Zero();
  Eigen::Matrix<double, 6, Eigen::Dynamic> right;
  Eigen::Matrix3d seen = Eigen::Matrix3d::Zero();  ///< Part of A that comes from its observations.
};

/// Normal equations of path and parameters; block-tridiagonal in the path.
class Equations {
 public:
  Equations(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
            std::span<const PathState> path, const TrackerConfig& config, double sigma_a_m_s2, bool with_params)
      : columns_(heads), num_(with_params ? columns_.num : 0), whole_(Eigen::MatrixXd::Zero(1 + num_, 1 + num_)) {
    constexpr double together_s = 1e-4;  // within so little time the target is in one state
    const ConstantVelocity motion{sigma_a_m_s2};
    for (std::size_t i = 0; i < observations.size(); ++i) {
      const double dt_s = i > 0 ? observations[i].t_capture_s - observations[instant_starts_].t_capture_s : 0.0;
      if (i == 0 || dt_s > together_s) {
        begin(i > 0 ? std::optional<double>(dt_s) : std::nullopt, path[instant_starts_], path[i], motion);
        instant_starts_ = i;
      }
      at_.push_back(instants_.size() - 1);
      add(observations[i], heads, path[instant_starts_], config);
    }
    seen_ = whole_.diagonal().tail(num_);
    eliminate();
  }

  [[nodiscard]] PathEquations given() const {
    PathEquations result;
    result.information = whole_.bottomRightCorner(num_, num_);
    result.g = whole_.col(0).tail(num_);
    result.cost = whole_(0, 0);
    result.seen = seen_;
    result.expected_cost = expected_cost();
    return result;
  }

  /// The path that fits the observations best, if all parameters are correct.
  [[nodiscard]] TargetPath path(std::span<const PathState> linearised) const {
    TargetPath moved(instants_.size());
    for (std::size_t k = instants_.size(); k-- > 0;) {
      PathState right = instants_[k].right.col(0);
      if (k + 1 < instants_.size()) right -= instants_[k + 1].before.transpose() * moved[k + 1];
      moved[k] = inverse_[k] * right;
    }
    TargetPath result;
    std::size_t first = 0;
    for (std::size_t i = 0; i < at_.size(); ++i) {
      if (i > 0 && at_[i] != at_[i - 1]) first = i;
      result.push_back(linearised[first] + moved[at_[i]]);
    }
    return result;
  }

 private:
  /// Adds a state after the one before; the first has a wide prior.
  void begin(std::optional<double> dt_s, const PathState& before, const PathState& now,
             const ConstantVelocity& motion) {
    constexpr double anywhere_m = 100.0, any_m_s = 100.0;
    Instant instant;
    instant.right.setZero(6, 1 + num_);
    if (!dt_s) {
      instant.A.diagonal() << Eigen::Vector3d::Constant(1.0 / (anywhere_m * anywhere_m)),
          Eigen::Vector3d::Constant(1.0 / (any_m_s * any_m_s));
    } else {
      const Six F = motion.transition_jacobian(before, *dt_s), inverse = inverse_symmetric(motion.noise(*dt_s));
      const PathState off = now - F * before;
      Instant& last = instants_.back();
      last.A += F.transpose() * inverse * F;
      last.right.col(0) += F.transpose() * (inverse * off);
      instant.A = inverse;
      instant.before = -inverse * F;
      instant.right.col(0) = -inverse * off;
      whole_(0, 0) += off.dot(inverse * off);
    }
    instants_.push_back(std::move(instant));
  }

  void add(const TargetObservation& observation, std::span<const RigHead> heads, const PathState& state,
           const TrackerConfig& config) {
    const RigHead& head = heads[observation.head];
    const double own = head.head.encoder.sigma_rad;
    const ObservationModel see(head, observation.pan_tilt_rad, sigma_px_of(observation, config.sigma_px),
                               own > 0.0 ? own : config.sigma_encoder_rad, observation.lens);
    const auto seen = see(state.head<3>());
    const auto by = rig_param_effect(see.turned, *see.camera, state.head<3>(), state.tail<3>(), observation.lens);
    if (!seen || !by) return;
    const Eigen::Matrix2d weight = seen->R.inverse();
    const Eigen::Matrix<double, 3, 2> Jt = seen->J_z_position.transpose();
    const Eigen::Vector2d residual = weight * (observation.px - seen->z);
    Instant& instant = instants_.back();
    instant.seen += Jt * weight * Jt.transpose();
    instant.A.topLeftCorner<3, 3>() += Jt * weight * Jt.transpose();
    instant.right.col(0).head<3>() += Jt * residual;
    whole_(0, 0) += residual.dot(observation.px - seen->z);
    if (num_ > 0) add_params(observation.head, *by, weight, residual, Jt);
    ++num_observations_;
  }

  void add_params(std::size_t head, const RigParamEffect& by, const Eigen::Matrix2d& weight,
                  const Eigen::Vector2d& residual, const Eigen::Matrix<double, 3, 2>& Jt) {
    const Eigen::Index first = 1 + columns_.first[head], num = by.cols();
    const Eigen::Matrix<double, 2, Eigen::Dynamic> weighted = weight * by;
    instants_.back().right.block(0, first, 3, num) += Jt * weighted;
    const Eigen::VectorXd pull = by.transpose() * residual;
    whole_.block(first, 0, num, 1) += pull;
    whole_.block(0, first, 1, num) += pull.transpose();
    whole_.block(first, first, num, num) += by.transpose() * weighted;
  }

  /// Forward elimination: each state with the information up to it; whole_ then depends on the parameters alone.
  void eliminate() {
    for (std::size_t k = 0; k < instants_.size(); ++k) {
      Instant& now = instants_[k];
      if (k > 0) {
        const Six G = now.before * inverse_[k - 1];
        now.A -= G * now.before.transpose();
        now.right -= G * instants_[k - 1].right;
      }
      inverse_.push_back(inverse_symmetric(now.A));
      const Eigen::MatrixXd solved = inverse_.back() * now.right;
      whole_.noalias() -= now.right.transpose() * solved;
    }
  }

  /// Expected cost of 2 n whitened residuals less what the path absorbs: Σ tr(R⁻¹ J Σ Jᵀ), Σ the smoothed covariance.
  [[nodiscard]] double expected_cost() const {
    double taken = 0.0;
    Six cov = Six::Zero();
    for (std::size_t k = instants_.size(); k-- > 0;) {
      if (k + 1 < instants_.size()) {
        const Six G = inverse_[k] * instants_[k + 1].before.transpose();
        cov = inverse_[k] + (G * cov * G.transpose()).eval();
      } else {
        cov = inverse_[k];
      }
      taken += (instants_[k].seen * cov.topLeftCorner<3, 3>()).trace();
    }
    return 2.0 * static_cast<double>(num_observations_) - taken;
  }

  Columns columns_;
  Eigen::Index num_ = 0;
  Eigen::MatrixXd whole_;  ///< Block of the residuals and the parameters.
  Eigen::VectorXd seen_;
  std::vector<Instant> instants_;
  std::vector<Six> inverse_;
  std::vector<std::size_t> at_;  ///< Index of each observation's instant.
  std::size_t instant_starts_ = 0, num_observations_ = 0;
};

/// Intersection of the observation's ray with the temporally nearest rays of the other heads.
std::optional<Eigen::Vector3d> meeting_at(std::span<const TargetObservation> observations,
                                          const std::vector<std::optional<WorldRay>>& rays, std::size_t at,
                                          double together_s) {
  const auto others_within = [&](std::size_t i) {
    return std::abs(observations[i].t_capture_s - observations[at].t_capture_s) <= together_s;
  };
  std::vector<std::size_t> met;  // one per other head
  const auto note = [&](std::size_t i) {
    if (observations[i].head == observations[at].head || !rays[i]) return;
    for (std::size_t& other : met) {
      if (observations[other].head != observations[i].head) continue;
      if (std::abs(observations[i].t_capture_s - observations[at].t_capture_s) <
          std::abs(observations[other].t_capture_s - observations[at].t_capture_s))
        other = i;
      return;
    }
    met.push_back(i);
  };
  if (!rays[at]) return std::nullopt;
  for (std::size_t i = at; i-- > 0 && others_within(i);) note(i);
  for (std::size_t i = at + 1; i < observations.size() && others_within(i); ++i) note(i);
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double num = 0.0;
  for (const std::size_t other : met) {
    const auto point = nearest_to_rays(*rays[at], *rays[other]);
    if (!point || !((*point - rays[at]->origin_in_world).dot(rays[at]->direction_in_world) > 0.0)) continue;
    sum += *point;
    num += 1.0;
  }
  if (!(num > 0.0)) return std::nullopt;
  return Eigen::Vector3d(sum / num);
}

/// The intersections of the rays; in between, the last one is kept.
std::optional<TargetPath> meeting_path(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       double together_s) {
  std::vector<std::optional<WorldRay>> rays;
  for (const TargetObservation& observation : observations)
    rays.push_back(ray_in_world(heads[observation.head], observation));
  TargetPath path;
  std::size_t num = 0, first = observations.size();
  for (std::size_t i = 0; i < observations.size(); ++i) {
    PathState state = path.empty() ? PathState(PathState::Zero()) : path.back();
    if (const auto point = meeting_at(observations, rays, i, together_s)) {
      state << *point, Eigen::Vector3d::Zero();
      first = std::min(first, i);
      ++num;
    }
    path.push_back(state);
  }
  if (2 * num < observations.size()) return std::nullopt;
  std::fill(path.begin(), path.begin() + static_cast<std::ptrdiff_t>(first), path[first]);
  return path;
}

}  // namespace

std::optional<TargetPath> smooth_path(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                      const TrackerConfig& config) {
  constexpr int num_steps = 4;
  auto path = meeting_path(observations, heads, config.together_s);
  for (int step = 0; path && step < num_steps; ++step) {
    *path = Equations(observations, heads, *path, config, config.sigma_a_m_s2, false).path(*path);
    if (!std::ranges::all_of(*path, [](const PathState& state) { return state.allFinite(); })) return std::nullopt;
  }
  return path;
}

PathEquations path_equations(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                             std::span<const PathState> path, const TrackerConfig& config, double free_m_s2) {
  return Equations(observations, heads, path, config, free_m_s2, true).given();
}

}  // namespace alidade
