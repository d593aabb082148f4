#pragma once

#include <array>
#include <deque>
#include <span>
#include <vector>

namespace alidade {

/// Limits of one axis of a head with position commands; the encoder is behind the backlash.
/// docs/maths/servo.md, "A head with position commands".
struct PositionerParams {
  double rate_rad_s = 0.7;           ///< Largest rate.
  double acceleration_rad_s2 = 2.0;  ///< When starting and braking.
  double time_constant_s = 0.06;     ///< Of the final approach.
  double latency_s = 0.04;           ///< From a command to the start of its effect.
  double backlash_rad = 0.0;         ///< Play between the drive and the encoder.
  double dead_band_rad = 0.0;        ///< At rest, a target within this distance has no effect.
};

struct DriveMotion {
  double angle_rad = 0.0, rate_rad_s = 0.0;
};

/// The next piece of a drive's motion towards `goal_rad`, at most `dt_s` long; returns its duration. The wanted
/// rate is the largest from which the drive can brake within its acceleration, or the remaining angle over the time
/// constant if less; the rate follows it within the acceleration limit. A piece is closed-form: constant acceleration,
/// the largest rate, or the final lag; it does not reverse.
[[nodiscard]] double advance_drive(const PositionerParams& params, double goal_rad, double dt_s, DriveMotion& motion);

/// Simulation of the axis. A command takes effect `latency_s` after it was given.
class Positioner {
 public:
  Positioner(const PositionerParams& params, double start_rad, double t_s);

  /// Commands in chronological order.
  void go_to(double t_s, double target_rad);
  void stop(double t_s);
  /// Cancels pending commands; the drive starts to brake.
  void cut(double t_s);
  /// Advances to that time; never backwards.
  void advance(double t_s);

  [[nodiscard]] double output_rad() const { return output_; }
  [[nodiscard]] double motor_rad() const { return motor_.angle_rad; }
  [[nodiscard]] bool is_at_rest() const { return is_at_rest_ && waiting_.empty(); }
  [[nodiscard]] double time_s() const { return t_; }

 private:
  struct Waiting {
    double acts_s, target_rad;
    bool is_stop;
  };
  void act(const Waiting& command);
  void move(double until_s);
  void come_to_rest();

  PositionerParams params_;
  std::deque<Waiting> waiting_;
  double t_, target_, output_;
  DriveMotion motor_;
  bool is_at_rest_ = true, is_stopping_ = false;
};

/// A command of a log, with its time.
struct PositionCommand {
  double t_s = 0.0, target_rad = 0.0;
};

/// Output of an axis that is at rest at `start_rad`, at ascending times.
[[nodiscard]] std::vector<double> positioner_response(const PositionerParams& params, double start_rad,
                                                      std::span<const PositionCommand> commands,
                                                      std::span<const double> times_s);

/// Resonance after an axis: part of its motion passes through a lightly damped mode, the rest is rigid,
/// y = (1 − share) x + share q with q'' = ω² (x − q) − 2ζω q'. A share of one: the whole load is on a spring; a
/// negative share: the encoder is before the spring.
struct Mode {
  double hz = 0.0;  ///< Natural frequency ω / 2π; 0: none.
  double damping = 0.0, share = 1.0;
  bool operator==(const Mode&) const = default;
};

/// State q over time. Exact while the motion of its drive is cubic; 0 < damping < 1.
class Resonance {
 public:
  /// Steady state: it has moved with the drive's rate for long.
  Resonance(const Mode& mode, const DriveMotion& drive);

  /// After dt, in which the drive's angle and rate changed from one to the other.
  void advance(double dt_s, const DriveMotion& from, const DriveMotion& to);
  [[nodiscard]] double angle_rad() const { return angle_; }

 private:
  /// Of the homogeneous equation over dt: a regular log has few step lengths.
  struct Swing {
    double dt_s = -1.0, decay = 1.0, cosine = 1.0, sine = 0.0;
  };
  const Swing& swing_over(double dt_s);

  double omega_, damping_, damped_omega_;
  double angle_, rate_;
  std::array<Swing, 2> known_{};
};

}  // namespace alidade
