#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <optional>

#include "alidade/pantilt/rig_uncertainty.h"
#include "alidade/track/target_filter.h"

// The beliefs of target_filter.h with uncertain heads, lenses and clocks: their errors u ~ N(0, I) are considered
// parameters, whose cross-covariance with the state is kept and which no observation changes (Schmidt–Kalman).
// S. F. Schmidt, "Application of state-space methods to navigation problems", 1966; Bierman, 1977, chapter VIII.

namespace alidade {

/// Cross-covariance of a state with u.
template <int N>
using WithErrors = Eigen::Matrix<double, N, Eigen::Dynamic, 0, N, max_rig_errors>;

/// u is considered: no observation changes it.
struct CountedErrors {
  void start(int) {}
  [[nodiscard]] static Eigen::Vector2d shift(const RigErrorEffect&) { return Eigen::Vector2d::Zero(); }
  [[nodiscard]] static Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2> carried(
      const RigErrorEffect& effect) {
    return effect.transpose();
  }
  void update(const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2>&, const Eigen::Vector2d&,
              const Eigen::Matrix2d&) {}
};

/// u is estimated as well: the innovations are white if the model is correct, and u shows the errors of the rig.
struct LearnedErrors {
  Eigen::Matrix<double, Eigen::Dynamic, 1, 0, max_rig_errors, 1> u;
  Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, 0, max_rig_errors, max_rig_errors> C;

  void start(int num) {
    u.setZero(num);
    C.setIdentity(num, num);
  }
  [[nodiscard]] Eigen::Vector2d shift(const RigErrorEffect& effect) const { return effect * u; }
  [[nodiscard]] Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2> carried(
      const RigErrorEffect& effect) const {
    return C.lazyProduct(effect.transpose());
  }
  void update(const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2>& CHt,
              const Eigen::Vector2d& weighted, const Eigen::Matrix2d& S_inverse) {
    u += CHt * weighted;
    const Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2> K = CHt * S_inverse;
    C -= K.lazyProduct(CHt.transpose());
  }
};

/// Cross-covariances of an observation with state and errors, and the covariance of the pixel.
template <int N>
struct SeenWithErrors {
  Eigen::Matrix<double, N, 2> PHt;
  Eigen::Matrix<double, Eigen::Dynamic, 2, 0, max_rig_errors, 2> CHt;
  Eigen::Matrix2d S;

  template <class Errors>
  SeenWithErrors(const Belief<N>& belief, const WithErrors<N>& cross, const Errors& errors, const PositionSeen& seen,
                 const RigErrorEffect& effect) {
    const Eigen::Matrix<double, 2, 3>& H = seen.J_z_position;
    PHt.noalias() = belief.P.template leftCols<3>() * H.transpose();
    PHt.noalias() += cross.lazyProduct(effect.transpose());
    CHt = errors.carried(effect);
    S.noalias() = H * PHt.template topRows<3>() + seen.R;
    CHt.noalias() += cross.template topRows<3>().transpose().lazyProduct(H.transpose());
    S.noalias() += effect.lazyProduct(CHt);
    S(1, 0) = S(0, 1) = 0.5 * (S(0, 1) + S(1, 0));
  }
};

template <int N, class Errors>
[[nodiscard]] Innovation innovation_with_errors(const Belief<N>& belief, const WithErrors<N>& cross,
                                                const Errors& errors, const PositionSeen& seen,
                                                const RigErrorEffect& effect, const Eigen::Vector2d& z) {
  Innovation result;
  result.nu = z - seen.z - errors.shift(effect);
  result.S = SeenWithErrors<N>(belief, cross, errors, seen, effect).S;
  result.nis = result.nu.dot(inverse_of_symmetric(result.S) * result.nu);
  return result;
}

/// iterated_update() with errors. Their effect on the pixel is linear: with h = h(x) + H_u u the Gauss–Newton step of
/// the state is that without them, with the gain of both. False, and no change, if it does not converge.
template <int N, class Errors>
[[nodiscard]] bool update_with_errors(Belief<N>& belief, WithErrors<N>& cross, Errors& errors,
                                      const PositionSeen& expected, const RigErrorEffect& effect,
                                      const Eigen::Vector2d& z, const ObservationModel& see,
                                      const IteratedUpdateConfig& config) {
  const Eigen::Vector3d start = belief.x.template head<3>();
  const double tolerance2 = config.tolerance * config.tolerance;
  const Eigen::Vector2d z_without = z - errors.shift(effect);
  PositionSeen seen = expected;
  Eigen::Vector3d position = start;
  SeenWithErrors<N> by(belief, cross, errors, seen, effect);
  Eigen::Matrix2d S_inverse = inverse_of_symmetric(by.S);
  Eigen::Vector2d weighted = S_inverse * (z_without - seen.z);
  for (int iteration = 1; iteration < config.max_iterations; ++iteration) {
    const Eigen::Vector3d next = start + by.PHt.template topRows<3>() * weighted;
    const std::optional<PositionSeen> there = see(next);
    if (!there) return false;
    const Eigen::Vector2d bend = there->z - seen.z - seen.J_z_position * (next - position);
    if (bend[0] * bend[0] < tolerance2 * seen.R(0, 0) && bend[1] * bend[1] < tolerance2 * seen.R(1, 1)) break;
    position = next;
    seen = *there;
    by = SeenWithErrors<N>(belief, cross, errors, seen, effect);
    S_inverse = inverse_of_symmetric(by.S);
    weighted = S_inverse * (z_without - seen.z - seen.J_z_position * (start - position));
  }
  Belief<N> updated = belief;
  const Eigen::Matrix<double, N, 2> K = by.PHt * S_inverse;
  updated.x += by.PHt * weighted;
  joseph_update<N>(updated.P, K, by.PHt, by.S, Eigen::Matrix2d::Zero());
  if (!updated.x.allFinite() || !(updated.P.diagonal().minCoeff() > 0.0)) return false;
  belief = updated;
  cross.noalias() -= K.lazyProduct(by.CHt.transpose());
  errors.update(by.CHt, weighted, S_inverse);
  return true;
}

/// A target with one motion model, observed by heads with errors.
template <MotionModel Model, class Errors = CountedErrors>
struct ConsideredFilter {
  static constexpr bool can_smooth = true, considers = true;
  struct Models {
    Model motion;
    double start_sigma_rest = 1.0;
    int num_errors = 0;
  };
  ModelFilter<Model> own;
  WithErrors<Model::dim> cross;
  Errors errors;

  void start(const Models& models, const Belief<6>& first) {
    own.start({models.motion, models.start_sigma_rest}, first);
    cross.setZero(Model::dim, models.num_errors);
    errors.start(models.num_errors);
  }
  void predict(const Models& models, double dt_s) {
    if (!(dt_s > 0.0)) return;
    cross = models.motion.transition_jacobian(own.belief.x, dt_s).lazyProduct(cross).eval();
    own.belief = models.motion.predicted(own.belief, dt_s);
  }
  [[nodiscard]] Eigen::Vector3d position() const { return own.position(); }
  [[nodiscard]] Eigen::Vector3d velocity() const { return own.belief.x.template segment<3>(3); }
  [[nodiscard]] Innovation expect(const PositionSeen& seen, const RigErrorEffect& effect,
                                  const Eigen::Vector2d& z) const {
    return innovation_with_errors(own.belief, cross, errors, seen, effect, z);
  }
  [[nodiscard]] bool update(const PositionSeen& seen, const RigErrorEffect& effect, const Eigen::Vector2d& z,
                            const ObservationModel& see, const IteratedUpdateConfig& config) {
    return update_with_errors(own.belief, cross, errors, seen, effect, z, see, config);
  }
  [[nodiscard]] Belief<6> estimate() const { return own.estimate(); }
  /// What u does to the state is smoothed by itself, and exactly; the rest by the rule of the optimal filter.
  [[nodiscard]] ConsideredFilter smoothed(const Models& models, const ConsideredFilter& later, double dt_s) const {
    using Square = Eigen::Matrix<double, Model::dim, Model::dim>;
    if (!(dt_s > 0.0)) return later;
    const Square F = models.motion.transition_jacobian(own.belief.x, dt_s);
    const Belief<Model::dim> ahead = models.motion.predicted(own.belief, dt_s);
    const Square FP = F * own.belief.P;
    const Square G = ahead.P.ldlt().solve(FP).transpose();
    const WithErrors<Model::dim> cross_ahead = F.lazyProduct(cross);
    const auto without_u = [](const Square& P, const WithErrors<Model::dim>& by_u) -> Square {
      return P - by_u.lazyProduct(by_u.transpose());
    };
    ConsideredFilter result = *this;
    const WithErrors<Model::dim> apart = later.cross - cross_ahead;
    result.cross.noalias() += G.lazyProduct(apart);
    result.own.belief.x += G * (later.own.belief.x - ahead.x);
    const Square rest = without_u(later.own.belief.P, later.cross) - without_u(ahead.P, cross_ahead);
    result.own.belief.P = without_u(own.belief.P, cross) + G * rest * G.transpose();
    result.own.belief.P += result.cross.lazyProduct(result.cross.transpose());
    mirror_upper<Model::dim>(result.own.belief.P);
    return result;
  }
};

/// A target that switches between quiet, agile and falling, observed by heads with errors.
struct ConsideredInteracting {
  static constexpr bool can_smooth = false, considers = true;
  struct Models {
    InteractingModels motion;
    int num_errors = 0;
  };
  InteractingFilter own;
  WithErrors<6> quiet, falling;
  WithErrors<9> agile;

  void start(const Models& models, const Belief<6>& first) {
    own.start(models.motion, first);
    quiet.setZero(6, models.num_errors);
    agile.setZero(9, models.num_errors);
    falling.setZero(6, models.num_errors);
  }
  /// u has the same mean in all models: mixing weighs its covariances as it does the means.
  void predict(const Models& models, double dt_s) {
    if (!(dt_s > 0.0)) return;
    const Eigen::Matrix3d joint = own.belief.mu.asDiagonal() * models.motion.transition_probabilities(dt_s);
    const Eigen::RowVector3d next = joint.colwise().sum();
    const auto of_six = [&](int to) -> WithErrors<6> {
      return (joint(0, to) * quiet + joint(1, to) * agile.topRows<6>() + joint(2, to) * falling) / next[to];
    };
    const WithErrors<6> mixed_quiet = of_six(0), mixed_falling = of_six(2);
    WithErrors<9> mixed_agile = (joint(1, 1) / next[1]) * agile;
    mixed_agile.topRows<6>() += (joint(0, 1) / next[1]) * quiet + (joint(2, 1) / next[1]) * falling;
    quiet = models.motion.quiet.transition_jacobian(own.belief.quiet.x, dt_s).lazyProduct(mixed_quiet);
    agile = models.motion.agile.transition_jacobian(own.belief.agile.x, dt_s).lazyProduct(mixed_agile);
    falling = models.motion.falling.transition_jacobian(own.belief.falling.x, dt_s).lazyProduct(mixed_falling);
    own.predict(models.motion, dt_s);
  }
  [[nodiscard]] Eigen::Vector3d position() const { return own.position(); }
  [[nodiscard]] Eigen::Vector3d velocity() const { return own.belief.mean().tail<3>(); }
  [[nodiscard]] Innovation expect(const PositionSeen& seen, const RigErrorEffect& effect,
                                  const Eigen::Vector2d& z) const {
    const Eigen::Vector3d& mu = own.belief.mu;
    const WithErrors<6> cross = mu[0] * quiet + mu[1] * agile.topRows<6>() + mu[2] * falling;
    return innovation_with_errors(own.belief.merged(), cross, CountedErrors{}, seen, effect, z);
  }
  [[nodiscard]] bool update(const PositionSeen&, const RigErrorEffect& effect, const Eigen::Vector2d& z,
                            const ObservationModel& see, const IteratedUpdateConfig& config) {
    ConsideredInteracting next = *this;
    const auto of_quiet = updated(next.own.belief.quiet, next.quiet, effect, z, see, config);
    const auto of_agile = updated(next.own.belief.agile, next.agile, effect, z, see, config);
    const auto of_falling = updated(next.own.belief.falling, next.falling, effect, z, see, config);
    if (!of_quiet || !of_agile || !of_falling) return false;
    *this = next;
    own.belief.weigh(*of_quiet, *of_agile, *of_falling);
    return true;
  }
  [[nodiscard]] Belief<6> estimate() const { return own.estimate(); }

 private:
  /// Updates one model; the innovation that it used.
  template <int N>
  [[nodiscard]] static std::optional<Innovation> updated(Belief<N>& belief, WithErrors<N>& cross,
                                                         const RigErrorEffect& effect, const Eigen::Vector2d& z,
                                                         const ObservationModel& see,
                                                         const IteratedUpdateConfig& config) {
    const auto seen = see(belief.x.template head<3>());
    if (!seen) return std::nullopt;
    CountedErrors errors;
    const Innovation innovation = innovation_with_errors(belief, cross, errors, *seen, effect, z);
    if (!update_with_errors(belief, cross, errors, *seen, effect, z, see, config)) return std::nullopt;
    return innovation;
  }
};

}  // namespace alidade
