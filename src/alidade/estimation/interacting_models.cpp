#include "alidade/estimation/interacting_models.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double least_probability = 1e-4;  // else a model that was wrong for long never comes back

Belief<9> with_acceleration(const Belief<6>& belief, double sigma_a_m_s2) {
  Belief<9> result;
  result.x << belief.x, Eigen::Vector3d::Zero();
  result.P.setZero();
  result.P.topLeftCorner<6, 6>() = belief.P;
  result.P.bottomRightCorner<3, 3>().diagonal().setConstant(sigma_a_m_s2 * sigma_a_m_s2);
  return result;
}

Belief<6> without_acceleration(const Belief<9>& belief) { return {belief.x.head<6>(), belief.P.topLeftCorner<6, 6>()}; }

template <int N>
Belief<N> mixed(const Belief<N>& a, const Belief<N>& b, double weight_of_a) {
  const double weight_of_b = 1.0 - weight_of_a;
  const Eigen::Vector<double, N> apart = a.x - b.x;
  Belief<N> result;
  result.x = weight_of_a * a.x + weight_of_b * b.x;
  result.P = weight_of_a * a.P + weight_of_b * b.P + (weight_of_a * weight_of_b) * apart * apart.transpose();
  mirror_upper<N>(result.P);
  return result;
}

/// log of the density of an innovation, but for the constant.
double log_likelihood(const Innovation& innovation) {
  return -0.5 * (innovation.nis + std::log(innovation.S.determinant()));
}

void keep_both(Eigen::Vector2d& mu) {
  mu = mu.cwiseMax(least_probability);
  mu /= mu.sum();
}

}  // namespace

Eigen::Matrix2d InteractingModels::transition_probabilities(double dt_s) const {
  const double sum = to_agile + to_quiet;
  const double decay = std::pow(1.0 - sum, dt_s / acceleration_hold_s);
  const double in_agile = to_agile / sum, in_quiet = to_quiet / sum;  // in the long run
  Eigen::Matrix2d result;
  result << in_quiet + decay * in_agile, in_agile * (1.0 - decay), in_quiet * (1.0 - decay),
      in_agile + decay * in_quiet;
  return result;
}

void InteractingBelief::predict(const InteractingModels& models, double dt_s) {
  if (!(dt_s > 0.0)) return;
  const Eigen::Matrix2d joint = mu.asDiagonal() * models.transition_probabilities(dt_s);
  const Eigen::Vector2d next = joint.colwise().sum();
  const Belief<6> agile_as_quiet = without_acceleration(agile);
  const Belief<9> quiet_as_agile = with_acceleration(quiet, models.agile.sigma_a_m_s2);
  quiet = models.quiet.predicted(mixed<6>(quiet, agile_as_quiet, joint(0, 0) / next[0]), dt_s);
  agile = models.agile.predicted(mixed<9>(quiet_as_agile, agile, joint(0, 1) / next[1]), dt_s);
  mu = next;
  keep_both(mu);
}

void InteractingBelief::weigh(const Innovation& of_quiet, const Innovation& of_agile) {
  const double log_quiet = log_likelihood(of_quiet), log_agile = log_likelihood(of_agile);
  const double most = std::max(log_quiet, log_agile);
  mu[0] *= std::exp(log_quiet - most);
  mu[1] *= std::exp(log_agile - most);
  if (!(mu.sum() > 0.0)) mu.setConstant(0.5);
  mu /= mu.sum();
  keep_both(mu);
}

Belief<6> InteractingBelief::merged() const { return mixed<6>(quiet, without_acceleration(agile), mu[0]); }

}  // namespace alidade
