#pragma once

#include <Eigen/Core>
#include <array>

#include "alidade/estimation/iterated_update.h"
#include "alidade/estimation/motion_models.h"

namespace alidade {

/// Two models that take turns: a quiet one of constant velocity and an agile one of Singer's.
struct InteractingModels {
  ConstantVelocity quiet{0.15};
  Singer agile;
  /// From quiet to agile and back, in each 0.05 s.
  double to_agile = 0.03, to_quiet = 0.06;

  /// Π over any time: the power of the two-state chain.
  [[nodiscard]] Eigen::Matrix2d transition_probabilities(double dt_s) const;
};

/// Interacting multiple models: each model's belief, and how probable it is.
/// Blom & Bar-Shalom, "The interacting multiple model algorithm for systems with Markovian switching coefficients",
/// 1988. The quiet model's acceleration enters the mix as Singer's stationary one, else mixing would make it sure.
struct InteractingBelief {
  Belief<6> quiet;
  Belief<9> agile;
  Eigen::Vector2d mu{0.5, 0.5};  ///< Of quiet and agile.

  void predict(const InteractingModels& models, double dt_s);
  /// After the models were updated with these innovations.
  void weigh(const Innovation& of_quiet, const Innovation& of_agile);
  /// The Gaussian of the same mean and covariance.
  [[nodiscard]] Belief<6> merged() const;
};

}  // namespace alidade
