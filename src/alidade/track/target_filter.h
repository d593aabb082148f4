#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <optional>

#include "alidade/estimation/interacting_models.h"
#include "alidade/estimation/iterated_update.h"
#include "alidade/estimation/motion_models.h"
#include "alidade/track/observation_model.h"

// The beliefs that a tracker can carry, behind one interface: start, predict, expect, update, estimate.

namespace alidade {

/// A target with one motion model.
template <MotionModel Model>
struct ModelFilter {
  static constexpr bool can_smooth = true, considers = false;
  struct Models {
    Model motion;
    double start_sigma_rest = 1.0;  ///< Initial σ of the state's components beyond position and velocity.
  };
  Belief<Model::dim> belief;

  void start(const Models& models, const Belief<6>& first) {
    belief.x.setZero();
    belief.P.setIdentity();
    belief.P *= models.start_sigma_rest * models.start_sigma_rest;
    belief.x.template head<6>() = first.x;
    belief.P.template topLeftCorner<6, 6>() = first.P;
  }
  void predict(const Models& models, double dt_s) {
    if (dt_s > 0.0) belief = models.motion.predicted(belief, dt_s);
  }
  [[nodiscard]] Eigen::Vector3d position() const { return belief.x.template head<3>(); }
  [[nodiscard]] Innovation expect(const PositionSeen& seen, const Eigen::Vector2d& z) const {
    return innovation_of(belief, seen, z);
  }
  /// False, and no change, if the update does not converge.
  [[nodiscard]] bool update(const PositionSeen& seen, const Eigen::Vector2d& z, const ObservationModel& see,
                            const IteratedUpdateConfig& config) {
    const auto updated = iterated_update(belief, seen, z, see, config);
    if (updated) belief = *updated;
    return updated.has_value();
  }
  [[nodiscard]] Belief<6> estimate() const {
    return {belief.x.template head<6>(), belief.P.template topLeftCorner<6, 6>()};
  }
  /// This belief, given the belief dt later: one backward step of the smoother.
  /// Rauch, Tung & Striebel, "Maximum likelihood estimates of linear dynamic systems", 1965.
  [[nodiscard]] ModelFilter smoothed(const Models& models, const ModelFilter& later, double dt_s) const {
    if (!(dt_s > 0.0)) return later;
    const Belief<Model::dim> ahead = models.motion.predicted(belief, dt_s);
    const Eigen::Matrix<double, Model::dim, Model::dim> FP =
        models.motion.transition_jacobian(belief.x, dt_s) * belief.P;
    const Eigen::Matrix<double, Model::dim, Model::dim> G = ahead.P.ldlt().solve(FP).transpose();
    ModelFilter result = *this;
    result.belief.x += G * (later.belief.x - ahead.x);
    result.belief.P += G * (later.belief.P - ahead.P) * G.transpose();
    mirror_upper<Model::dim>(result.belief.P);
    return result;
  }
};

/// A target that switches between quiet, agile and falling.
struct InteractingFilter {
  static constexpr bool can_smooth = false, considers = false;
  using Models = InteractingModels;
  InteractingBelief belief;

  void start(const Models& models, const Belief<6>& first) {
    belief.quiet = first;
    ModelFilter<Singer> agile;
    agile.start({models.agile, models.agile.sigma_a_m_s2}, first);
    belief.agile = agile.belief;
    belief.falling = first;
    belief.mu = {0.49, 0.49, 0.02};
  }
  void predict(const Models& models, double dt_s) { belief.predict(models, dt_s); }
  [[nodiscard]] Eigen::Vector3d position() const { return belief.mean().head<3>(); }
  [[nodiscard]] Innovation expect(const PositionSeen& seen, const Eigen::Vector2d& z) const {
    return innovation_of(belief.merged(), seen, z);
  }
  [[nodiscard]] bool update(const PositionSeen&, const Eigen::Vector2d& z, const ObservationModel& see,
                            const IteratedUpdateConfig& config) {
    const auto by_quiet = see(belief.quiet.x.head<3>()), by_agile = see(belief.agile.x.head<3>());
    const auto by_falling = see(belief.falling.x.head<3>());
    if (!by_quiet || !by_agile || !by_falling) return false;
    const auto quiet = iterated_update(belief.quiet, *by_quiet, z, see, config);
    const auto agile = iterated_update(belief.agile, *by_agile, z, see, config);
    const auto falling = iterated_update(belief.falling, *by_falling, z, see, config);
    if (!quiet || !agile || !falling) return false;
    belief.weigh(innovation_of(belief.quiet, *by_quiet, z), innovation_of(belief.agile, *by_agile, z),
                 innovation_of(belief.falling, *by_falling, z));
    belief.quiet = *quiet;
    belief.agile = *agile;
    belief.falling = *falling;
    return true;
  }
  [[nodiscard]] Belief<6> estimate() const { return belief.merged(); }
};

}  // namespace alidade
