#include "alidade/estimation/interacting_models.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

namespace alidade {
namespace {

constexpr double min_probability = 1e-4;  // else a model that was wrong for long never comes back

Belief<9> with_acceleration(const Belief<6>& belief, double sigma_a_m_s2) {
  Belief<9> result;
  result.x << belief.x, Eigen::Vector3d::Zero();
  result.P.setZero();
  result.P.topLeftCorner<6, 6>() = belief.P;
  result.P.bottomRightCorner<3, 3>().diagonal().setConstant(sigma_a_m_s2 * sigma_a_m_s2);
  return result;
}

Belief<6> without_acceleration(const Belief<9>& belief) { return {belief.x.head<6>(), belief.P.topLeftCorner<6, 6>()}; }

/// The Gaussian of the same mean and covariance as a mixture.
template <int N>
Belief<N> mixed(const std::array<const Belief<N>*, 3>& beliefs, const Eigen::Vector3d& weights) {
  Belief<N> result;
  result.x = weights[0] * beliefs[0]->x + weights[1] * beliefs[1]->x + weights[2] * beliefs[2]->x;
  result.P.setZero();
  for (std::size_t i = 0; i < 3; ++i) {
    const double weight = weights[static_cast<Eigen::Index>(i)];
    const Eigen::Vector<double, N> apart = beliefs[i]->x - result.x;
    result.P += weight * beliefs[i]->P + weight * apart * apart.transpose();
  }
  mirror_upper<N>(result.P);
  return result;
}

/// log of the density of an innovation, but for the constant.
double log_likelihood(const Innovation& innovation) {
  return -0.5 * (innovation.nis + std::log(innovation.S.determinant()));
}

void keep_all(Eigen::Vector3d& mu) {
  mu = mu.cwiseMax(min_probability);
  mu /= mu.sum();
}

}  // namespace

Eigen::Matrix3d InteractingModels::transition_probabilities(double dt_s) const {
  Eigen::Matrix3d rates;
  const double out = from_falling_per_s;
  rates << -to_agile_per_s - to_falling_per_s, to_agile_per_s, to_falling_per_s,  //
      to_quiet_per_s, -to_quiet_per_s - to_falling_per_s, to_falling_per_s,       //
      0.0, out, -out;
  // exp(2^-k A) by its series, squared k times: to 10^-12.
  const double size = dt_s * rates.cwiseAbs().maxCoeff();
  const int squarings = std::max(0, std::ilogb(std::max(size, 1e-12)) + 5);
  const Eigen::Matrix3d A = rates * std::ldexp(dt_s, -squarings);
  Eigen::Matrix3d result = Eigen::Matrix3d::Identity(), term = result;
  for (int k = 1; k <= 7; ++k) {
    term = (term * A / k).eval();
    result += term;
  }
  for (int k = 0; k < squarings; ++k) result = (result * result).eval();
  return result;
}

void InteractingBelief::predict(const InteractingModels& models, double dt_s) {
  if (!(dt_s > 0.0)) return;
  const Eigen::Matrix3d joint = mu.asDiagonal() * models.transition_probabilities(dt_s);
  const Eigen::Vector3d next = joint.colwise().sum();
  const double sigma_a = models.agile.sigma_a_m_s2;
  const Belief<6> agile_of_six = without_acceleration(agile);
  const Belief<9> quiet_of_nine = with_acceleration(quiet, sigma_a),
                  falling_of_nine = with_acceleration(falling, sigma_a);
  const Belief<6> before_quiet = mixed<6>({&quiet, &agile_of_six, &falling}, joint.col(0) / next[0]);
  const Belief<6> before_falling = mixed<6>({&quiet, &agile_of_six, &falling}, joint.col(2) / next[2]);
  agile = models.agile.predicted(mixed<9>({&quiet_of_nine, &agile, &falling_of_nine}, joint.col(1) / next[1]), dt_s);
  quiet = models.quiet.predicted(before_quiet, dt_s);
  falling = models.falling.predicted(before_falling, dt_s);
  mu = next;
  keep_all(mu);
}

void InteractingBelief::weigh(const Innovation& of_quiet, const Innovation& of_agile, const Innovation& of_falling) {
  const Eigen::Vector3d logs(log_likelihood(of_quiet), log_likelihood(of_agile), log_likelihood(of_falling));
  mu = mu.cwiseProduct((logs.array() - logs.maxCoeff()).exp().matrix()).eval();
  if (!(mu.sum() > 0.0)) mu.setConstant(1.0 / 3.0);
  mu /= mu.sum();
  keep_all(mu);
}

Belief<6> InteractingBelief::merged() const {
  const Belief<6> agile_of_six = without_acceleration(agile);
  return mixed<6>({&quiet, &agile_of_six, &falling}, mu);
}

}  // namespace alidade
