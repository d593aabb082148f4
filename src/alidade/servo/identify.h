#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// One row of a servo's log: a command that is held until the next row, and the angle read at that time.
struct ServoSample {
  double t_s = 0.0, command = 0.0, angle_rad = 0.0;
};

/// Parameters of a servo in their order: gain [rad per unit, or rad/s per unit], time constant [s], latency [s], what
/// the encoder reads at angle zero [rad], start [rad, or rad/s: the angle of an angle plant, the rate of a rate plant,
/// at the first row].
inline constexpr int num_servo_params = 5;
using ServoParams = Eigen::Vector<double, num_servo_params>;
inline constexpr std::array<const char*, num_servo_params> servo_param_names{"gain", "tau_s", "latency_s", "zero",
                                                                             "start"};

/// How the angle answers: with a first-order lag itself (angle plant), or in its rate (rate plant).
enum class ServoKind { angle, rate };

/// Angles that a servo of these parameters reads at the times of a log, and their derivatives. Exact for held commands:
/// from one instant to the next in closed form, a switch of the command moving with the latency. Before the log the
/// first command is taken to have been there.
struct ServoResponse {
  Eigen::VectorXd angle_rad;
  Eigen::Matrix<double, Eigen::Dynamic, num_servo_params> J;
};
[[nodiscard]] ServoResponse servo_response(std::span<const ServoSample> log, ServoKind kind, const ServoParams& params);

struct ServoFit {
  ServoKind kind = ServoKind::angle;
  ServoParams params = ServoParams::Zero();
  /// Of the model that is believed: blocks of rows are clusters; of the other as `cov_model`.
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov = decltype(cov)::Zero();
  Eigen::Matrix<double, num_servo_params, num_servo_params> cov_model = decltype(cov)::Zero();  ///< Of white noise.
  double rms_rad = 0.0;  ///< Of the residuals, over the degrees of freedom.
  bool has_converged = false;
  bool is_observable = false;  ///< The normal equations can be solved.
};

struct ServoIdentification {
  ServoFit fit;                      ///< The model that is believed.
  ServoFit other;                    ///< The one that is not.
  std::vector<double> residual_rad;  ///< Response − reading.
  ClusterCovariance clusters;        ///< Blocks of rows; of the fit's parameters, whose covariance it is.
  std::size_t correlated_rows = 1;   ///< How many rows in a row share an error.
  double lag_one_correlation = 0.0;  ///< Of the residuals, one row to the next: near 0 where the model is enough.
  double command_range = 0.0, angle_range_rad = 0.0, duration_s = 0.0;
};

/// Least squares over both kinds of plant, from a search over time constant and latency (the rest is linear) refined by
/// Gauss–Newton with analytic derivatives. The rate plant is believed where its residuals are clearly the smaller.
/// G. H. Golub & V. Pereyra, "The differentiation of pseudo-inverses and nonlinear least squares problems whose
/// variables separate", 1973. At least 8 rows, in order of time.
[[nodiscard]] ServoIdentification identify_servo(std::span<const ServoSample> log);

/// Whether the model stands; what the log lacks where it does not.
[[nodiscard]] Verdict identify_verdict(std::span<const ServoSample> log, const ServoIdentification& identified);

}  // namespace alidade
