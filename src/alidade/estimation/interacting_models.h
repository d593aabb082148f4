#pragma once

#include <Eigen/Core>
#include <array>

#include "alidade/estimation/iterated_update.h"
#include "alidade/estimation/motion_models.h"

namespace alidade {

/// Three switching models: a quiet one (constant velocity), an agile one (Singer), and free fall.
struct InteractingModels {
  ConstantVelocity quiet{0.15};
  Singer agile;
  Ballistic falling{0.15};
  /// Rates of transition, per second. Between quiet and agile alone, 3 % and 6 % change within 0.05 s.
  double to_agile_per_s = 0.62874, to_quiet_per_s = 1.25747, to_falling_per_s = 0.1, from_falling_per_s = 0.4;

  /// Π over a time, ordered quiet, agile, falling: the exponential of the rates.
  [[nodiscard]] Eigen::Matrix3d transition_probabilities(double dt_s) const;
};

/// Interacting multiple models: the belief of each model, and its probability. Blom & Bar-Shalom, "The interacting
/// multiple model algorithm for systems with Markovian switching coefficients", 1988. Models without acceleration enter
/// the mix with Singer's stationary one, else mixing would make it certain.
struct InteractingBelief {
  Belief<6> quiet;
  Belief<9> agile;
  Belief<6> falling;
  Eigen::Vector3d mu{0.49, 0.49, 0.02};  ///< Probabilities of quiet, agile and falling.

  void predict(const InteractingModels& models, double dt_s);
  /// Updates the probabilities after the models were updated with these innovations.
  void weigh(const Innovation& of_quiet, const Innovation& of_agile, const Innovation& of_falling);
  [[nodiscard]] Eigen::Vector<double, 6> mean() const {
    return mu[0] * quiet.x + mu[1] * agile.x.head<6>() + mu[2] * falling.x;
  }
  /// The Gaussian with the same mean and covariance.
  [[nodiscard]] Belief<6> merged() const;
};

}  // namespace alidade
