#include "alidade/servo/identify/identify.h"
#include "alidade/servo/identify/sampled_log.h"

namespace alidade {
namespace {

/// Angle and rate of a plant during a log, with their derivatives by the parameters.
struct Walk {
  ServoKind kind;
  double gain, tau_s;
  Decay decays{tau_s};
  double x = 0.0, v = 0.0;  ///< Angle without its zero; rate (for rate plants).
  Eigen::RowVector<double, num_servo_params> dx = Eigen::RowVector<double, num_servo_params>::Zero(), dv = dx;

  /// Advances by dt with a constant command: x of an angle plant, or v of a rate plant, approaches gain · command.
  void advance(double dt_s, double command) {
    const auto [step_s, decay, rise] = decays.over(dt_s);
    const double goal = gain * command;
    const double decay_by_tau = decay * dt_s / (tau_s * tau_s);
    if (kind == ServoKind::angle) {
      dx *= decay;
      dx[ServoParam::gain] += rise * command;
      dx[ServoParam::tau] += decay_by_tau * (x - goal);
      x = goal + decay * (x - goal);
      return;
    }
    const double gap = v - goal, reach_s = tau_s * rise;
    dx += reach_s * dv;
    dx[ServoParam::gain] += (dt_s - reach_s) * command;
    dx[ServoParam::tau] += (rise - tau_s * decay_by_tau) * gap;
    dv *= decay;
    dv[ServoParam::gain] += rise * command;
    dv[ServoParam::tau] += decay_by_tau * gap;
    x += goal * dt_s + gap * reach_s;
    v = goal + decay * gap;
  }
  /// Derivative by a later switch: the previous command acts a little longer.
  void switch_command(double from, double to) {
    (kind == ServoKind::angle ? dx : dv)[ServoParam::latency] += gain * (from - to) / tau_s;
  }
};

}  // namespace

ServoResponse servo_response(std::span<const ServoSample> log, ServoKind kind, const ServoParams& params) {
  const std::vector<double> times_s = reading_times(log);
  const auto num_rows = static_cast<Eigen::Index>(times_s.size());
  ServoResponse response{Eigen::VectorXd(num_rows), decltype(response.J)(num_rows, num_servo_params)};
  Walk walk{kind, params[ServoParam::gain], params[ServoParam::tau]};
  if (kind == ServoKind::angle) {
    walk.x = params[ServoParam::start];
    walk.dx[ServoParam::start] = 1.0;
  } else {
    walk.v = params[ServoParam::start];
    walk.dv[ServoParam::start] = 1.0;
  }
  double now_s = std::min(log.front().t_s, times_s.front()), command = log.front().command;
  std::size_t next = 1;  // the first command was in effect before
  for (Eigen::Index i = 0; i < num_rows; ++i) {
    const double t_s = times_s[static_cast<std::size_t>(i)];
    for (; next < log.size() && log[next].given_s() + params[ServoParam::latency] <= t_s; ++next) {
      if (log[next].command == command) continue;
      const double switch_s = log[next].given_s() + params[ServoParam::latency];
      walk.advance(switch_s - now_s, command);
      walk.switch_command(command, log[next].command);
      now_s = switch_s;
      command = log[next].command;
    }
    walk.advance(t_s - now_s, command);
    now_s = t_s;
    response.angle_rad[i] = params[ServoParam::zero] + walk.x;
    response.J.row(i) = walk.dx;
    response.J(i, ServoParam::zero) = 1.0;
  }
  return response;
}

}  // namespace alidade
