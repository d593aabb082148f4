#pragma once

#include <Eigen/Core>
#include <cmath>
#include <concepts>
#include <optional>

#include "alidade/estimation/belief.h"
#include "alidade/estimation/innovation.h"

namespace alidade {

/// Two observed components of a position, their derivative with respect to it, and their noise if given.
struct PositionSeen {
  Eigen::Vector2d z;
  Eigen::Matrix<double, 2, 3> J_z_position;
  Eigen::Matrix2d R;
};

/// h(position), or none if it is not in view.
template <class See>
concept SeesPosition = requires(const See& see, const Eigen::Vector3d& position) {
  { see(position) } -> std::same_as<std::optional<PositionSeen>>;
};

struct IteratedUpdateConfig {
  int max_iterations = 4;   ///< Gauss–Newton steps, at most.
  double tolerance = 1e-3;  ///< Stop when the next step would change the measurement by less than this many σ.
};

/// S⁻¹ of a symmetric 2×2 matrix, or NaN if it is singular.
[[nodiscard]] inline Eigen::Matrix2d inverse_of_symmetric(const Eigen::Matrix2d& S) {
  const double determinant = S(0, 0) * S(1, 1) - S(0, 1) * S(0, 1);
  const double scale = determinant > 0.0 ? 1.0 / determinant : std::nan("");
  Eigen::Matrix2d inverse;
  inverse << S(1, 1) * scale, -S(0, 1) * scale, -S(0, 1) * scale, S(0, 0) * scale;
  return inverse;
}

template <int N>
[[nodiscard]] Innovation innovation_of(const Belief<N>& belief, const PositionSeen& expected,
                                       const Eigen::Vector2d& z) {
  Innovation result;
  const Eigen::Matrix<double, 2, 3> HP = expected.J_z_position * belief.P.template topLeftCorner<3, 3>();
  result.nu = z - expected.z;
  result.S = HP * expected.J_z_position.transpose() + expected.R;
  result.nis = result.nu.dot(inverse_of_symmetric(result.S) * result.nu);
  return result;
}

/// P − K H P − (P − K H P) Hᵀ Kᵀ + K R Kᵀ, where H depends on the position only: Joseph's form with products of rank 2.
/// G. J. Bierman, "Factorization Methods for Discrete Sequential Estimation", 1977, section II.5.
template <int N>
void joseph_update(Eigen::Matrix<double, N, N>& P, const Eigen::Matrix<double, N, 2>& K,
                   const Eigen::Matrix<double, N, 2>& PHt, const Eigen::Matrix2d& HPHt, const Eigen::Matrix2d& R) {
  const Eigen::Matrix2d S = HPHt + R;
  for (int i = 0; i < N; ++i) {  // by hand: small products of fixed size leave no temporary and half the work
    const double k0 = K(i, 0), k1 = K(i, 1);
    const double m0 = k0 * S(0, 0) + k1 * S(1, 0) - PHt(i, 0), m1 = k0 * S(0, 1) + k1 * S(1, 1) - PHt(i, 1);
    for (int j = i; j < N; ++j) P(i, j) += m0 * K(j, 0) + m1 * K(j, 1) - k0 * PHt(j, 0) - k1 * PHt(j, 1);
  }
  mirror_upper<N>(P);
}

/// Iterated extended Kalman update: x ← x̂ + K_j (z − h(x_j) − H_j (x̂ − x_j)), the covariance by Joseph's form at the
/// last H and R. `expected` is see(x̂). None if an iterate is not in view or the result is not finite; keep the prior
/// then. Bell & Cathey, "The iterated Kalman filter update as a Gauss–Newton method", 1993.
template <int N, SeesPosition See>
[[nodiscard]] std::optional<Belief<N>> iterated_update(const Belief<N>& prior, const PositionSeen& expected,
                                                       const Eigen::Vector2d& z, const See& see,
                                                       const IteratedUpdateConfig& config = {}) {
  const Eigen::Matrix3d P_position = prior.P.template topLeftCorner<3, 3>();
  const Eigen::Vector3d start = prior.x.template head<3>();
  const double tolerance2 = config.tolerance * config.tolerance;
  PositionSeen seen = expected;
  Eigen::Vector3d position = start;
  Eigen::Matrix<double, 2, 3> H = seen.J_z_position;
  Eigen::Matrix2d HPHt = Eigen::Matrix2d::Zero(), S_inverse = HPHt;
  Eigen::Vector2d weighted = Eigen::Vector2d::Zero();
  for (int iteration = 0; iteration < config.max_iterations; ++iteration) {
    H = seen.J_z_position;
    const Eigen::Matrix<double, 3, 2> PHt = P_position * H.transpose();
    HPHt.noalias() = H * PHt;
    S_inverse = inverse_of_symmetric(HPHt + seen.R);
    weighted = S_inverse * (z - seen.z - H * (start - position));
    const Eigen::Vector3d next = start + PHt * weighted;
    if (iteration + 1 == config.max_iterations) break;
    const std::optional<PositionSeen> there = see(next);
    if (!there) return std::nullopt;
    const Eigen::Vector2d bend = there->z - seen.z - H * (next - position);
    if (bend[0] * bend[0] < tolerance2 * seen.R(0, 0) && bend[1] * bend[1] < tolerance2 * seen.R(1, 1)) break;
    position = next;
    seen = *there;
  }
  Belief<N> result = prior;
  const Eigen::Matrix<double, N, 2> PHt = prior.P.template leftCols<3>() * H.transpose();
  const Eigen::Matrix<double, N, 2> K = PHt * S_inverse;
  result.x += PHt * weighted;
  joseph_update<N>(result.P, K, PHt, HPHt, seen.R);
  if (!result.x.allFinite() || !(result.P.diagonal().minCoeff() > 0.0)) return std::nullopt;
  return result;
}

}  // namespace alidade
