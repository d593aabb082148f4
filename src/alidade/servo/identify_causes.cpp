#include "alidade/servo/identify_causes.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/degree.h"

namespace alidade {
namespace {

double limited(double value, double most) { return most > 0.0 ? std::clamp(value, -most, most) : value; }

/// A servo half-way through its log.
struct FlawedServo {
  const ServoFit& fit;
  const ServoFlaws& flaws;
  double x, v, lagged, read;

  FlawedServo(const ServoFit& of, const ServoFlaws& has, double first_command)
      : fit(of), flaws(has), x(0.0), v(0.0), lagged(first_command), read(0.0) {
    (fit.kind == ServoKind::angle ? x : v) = fit.params[4];
    read = x;
  }
  void advance(double dt_s, double command) {
    const double gain = fit.params[0], tau_s = fit.params[1];
    lagged = flaws.second_tau_s > 0.0 ? command + (lagged - command) * std::exp(-dt_s / flaws.second_tau_s) : command;
    const double beyond = std::max(0.0, std::abs(lagged) - flaws.dead_band);
    const double goal = gain * std::copysign(beyond, lagged), share = -std::expm1(-dt_s / tau_s);
    if (fit.kind == ServoKind::angle) {
      const double before = v;
      v = limited((goal - x) * share / dt_s, flaws.max_rate_rad_s);
      if (flaws.max_acceleration_rad_s2 > 0.0) v = before + limited(v - before, flaws.max_acceleration_rad_s2 * dt_s);
      x += v * dt_s;
    } else {
      const double wanted = limited(goal, flaws.max_rate_rad_s), before = v;
      v += limited((wanted - v) * share, flaws.max_acceleration_rad_s2 * dt_s);
      x += 0.5 * (before + v) * dt_s;
    }
    const double half = 0.5 * flaws.backlash_rad;
    read = std::clamp(read, x - half, x + half);
  }
};

constexpr double sigmas_of_a_cause = 4.0;  // of some thirty trials the largest of a true model is below in 99.8 %

/// What a flaw of so many sizes is called, and how to set it.
struct Trial {
  const char* name;
  const char* unit;
  double ServoFlaws::*flaw;
  std::vector<double> sizes;
};

std::vector<Trial> trials_of(std::span<const ServoSample> log, const ServoFit& fit, const Eigen::VectorXd& response) {
  double most_command = 0.0, most_rate = 0.0;
  for (const ServoSample& row : log) most_command = std::max(most_command, std::abs(row.command));
  for (std::size_t i = 1; i < log.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    most_rate = std::max(most_rate, std::abs(response[at] - response[at - 1]) / (log[i].t_s - log[i - 1].t_s));
  }
  const double range = response.maxCoeff() - response.minCoeff();
  const auto times = [](double unit, std::initializer_list<double> factors) {
    std::vector<double> sizes;
    for (const double factor : factors) sizes.push_back(unit * factor);
    return sizes;
  };
  const std::initializer_list<double> limits{0.95, 0.9, 0.8, 0.65, 0.5, 0.35};
  return {{"a limit of its rate", "rad/s", &ServoFlaws::max_rate_rad_s, times(most_rate, limits)},
          {"a limit of its acceleration", "rad/s^2", &ServoFlaws::max_acceleration_rad_s2,
           times(most_rate / fit.params[1], {0.9, 0.7, 0.5, 0.3, 0.15})},
          {"a dead band", "units of command", &ServoFlaws::dead_band,
           times(most_command, {0.005, 0.01, 0.02, 0.05, 0.1, 0.2})},
          {"backlash", "rad", &ServoFlaws::backlash_rad, times(range, {0.002, 0.005, 0.01, 0.02, 0.05, 0.1})},
          {"a second lag", "s", &ServoFlaws::second_tau_s, times(fit.params[1], {0.1, 0.3, 0.6, 1.0})}};
}

}  // namespace

Eigen::VectorXd flawed_response(std::span<const ServoSample> log, const ServoFit& fit, const ServoFlaws& flaws) {
  Eigen::VectorXd angles(static_cast<Eigen::Index>(log.size()));
  FlawedServo servo(fit, flaws, log.front().command);
  double now_s = log.front().t_s, command = log.front().command;
  std::size_t next = 1;
  const auto go_to = [&](double until_s) {
    constexpr double most_steps = 64.0;
    const double span_s = until_s - now_s;
    const double steps = std::clamp(std::ceil(20.0 * span_s / fit.params[1]), 4.0, most_steps);
    for (double k = 0.0; span_s > 0.0 && k < steps; ++k) servo.advance(span_s / steps, command);
    now_s = until_s;
  };
  for (std::size_t i = 0; i < log.size(); ++i) {
    for (; next < log.size() && log[next].t_s + fit.params[2] <= log[i].t_s; ++next) {
      if (log[next].command == command) continue;
      go_to(log[next].t_s + fit.params[2]);
      command = log[next].command;
    }
    go_to(log[i].t_s);
    angles[static_cast<Eigen::Index>(i)] = fit.params[3] + servo.read;
  }
  return angles;
}

std::vector<ServoCause> servo_causes(std::span<const ServoSample> log, const ServoIdentification& identified) {
  const ServoFit& fit = identified.fit;
  std::vector<ServoCause> causes;
  if (!fit.is_observable || identified.residual_rad.empty()) return causes;
  const auto rows = static_cast<Eigen::Index>(log.size());
  const Eigen::MatrixXd J = servo_response(log, fit.kind, fit.params).J;
  const Eigen::MatrixXd across = orthonormal_basis(J, num_servo_params);
  const Eigen::Map<const Eigen::VectorXd> r(identified.residual_rad.data(), rows);
  const Eigen::VectorXd plain = flawed_response(log, fit, {});
  const double dof = static_cast<double>(rows) - num_servo_params - 1.0, sum2 = r.squaredNorm();
  for (const Trial& trial : trials_of(log, fit, plain)) {
    ServoCause best{trial.name, 0.0, trial.unit, 0.0};
    for (const double size : trial.sizes) {
      ServoFlaws flaws;
      flaws.*trial.flaw = size;
      Eigen::VectorXd added = flawed_response(log, fit, flaws) - plain;
      added -= across * (across.transpose() * added);  // the parameters follow
      const double own2 = added.squaredNorm(), along = -added.dot(r);
      // Only in the flaw's own direction, and nothing where the parameters can do all that it does.
      if (!(own2 > 1e-3 * fit.rms_rad * fit.rms_rad) || !(along > 0.0)) continue;
      const double gain2 = along * along / own2;
      const double sigmas = std::sqrt(gain2 * dof / std::max(sum2 - gain2, 1e-6 * sum2));
      if (sigmas > best.sigmas) best.sigmas = sigmas, best.size = size;
    }
    if (best.sigmas > sigmas_of_a_cause) causes.push_back(best);
  }
  std::ranges::sort(causes, std::greater{}, &ServoCause::sigmas);
  return causes;
}

std::size_t num_sizes(std::span<const ServoSample> log, std::size_t most) {
  constexpr double apart = 0.1;
  std::vector<double> sizes;
  for (const ServoSample& row : log) {
    const double size = std::abs(row.command);
    const bool is_known =
        std::ranges::any_of(sizes, [&](double known) { return std::abs(size - known) <= apart * known; });
    if (size > 0.0 && !is_known) sizes.push_back(size);
    if (sizes.size() >= most) break;
  }
  return sizes.size();
}

double encoder_step_rad(std::span<const ServoSample> log) {
  std::vector<double> angles;
  for (const ServoSample& row : log) angles.push_back(row.angle_rad);
  std::ranges::sort(angles);
  constexpr double same_rad = 1e-8;  // as files round
  double step = 0.0;
  for (std::size_t i = 1; i < angles.size(); ++i) {
    const double apart = angles[i] - angles[i - 1];
    if (apart > same_rad && (step == 0.0 || apart < step)) step = apart;
  }
  if (!(step > 100.0 * same_rad)) return 0.0;
  const bool is_multiple = std::ranges::all_of(angles, [&](double angle) {
    const double steps = (angle - angles.front()) / step;
    return std::abs(steps - std::round(steps)) < 0.02;
  });
  return is_multiple ? step : 0.0;
}

}  // namespace alidade
