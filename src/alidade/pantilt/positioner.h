#pragma once

#include <array>
#include <deque>
#include <span>
#include <vector>

namespace alidade {

/// The limits of one axis of a head that takes position commands; the encoder reads behind the backlash.
/// docs/maths/servo.md, "A head with position commands".
struct PositionerParams {
  double rate_rad_s = 0.7;           ///< Largest.
  double acceleration_rad_s2 = 2.0;  ///< Of starting and of braking.
  double time_constant_s = 0.06;     ///< With which it comes to rest at the end.
  double latency_s = 0.04;           ///< From a command to its first effect.
  double backlash_rad = 0.0;         ///< Play between the drive and what is read.
  double dead_band_rad = 0.0;        ///< At rest, a target that is no farther does nothing.
};

struct DriveMotion {
  double angle_rad = 0.0, rate_rad_s = 0.0;
};

/// The next piece of a drive's motion towards `goal_rad`, at most `dt_s` of it; returns how long it lasted. The wanted
/// rate is the largest from which the drive can brake at its acceleration, or the remaining angle over the time
/// constant if less; the rate follows it within the acceleration. A piece has one acceleration, the largest rate or the
/// lag at the end, in closed form, and does not turn back.
[[nodiscard]] double advance_drive(const PositionerParams& params, double goal_rad, double dt_s, DriveMotion& motion);

/// The axis in time. A command acts `latency_s` after it was given.
class Positioner {
 public:
  Positioner(const PositionerParams& params, double start_rad, double t_s);

  /// Commands in order of time.
  void go_to(double t_s, double target_rad);
  void stop(double t_s);
  /// Cancels pending commands; the drive brakes now.
  void cut(double t_s);
  /// Moves on to that time; never back.
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

/// A command of a log, and when it was given.
struct PositionCommand {
  double t_s = 0.0, target_rad = 0.0;
};

/// Output of an axis that rests at `start_rad`, at ascending times.
[[nodiscard]] std::vector<double> positioner_response(const PositionerParams& params, double start_rad,
                                                      std::span<const PositionCommand> commands,
                                                      std::span<const double> times_s);

/// What swings behind an axis: of its motion a part goes through a lightly damped mode, the rest is rigid,
/// y = (1 − share) x + share q with q'' = ω² (x − q) − 2ζω q'. A share of one: all of the load hangs on a spring; of
/// less than nothing: what is read sits before the spring.
struct Mode {
  double hz = 0.0;  ///< Its natural frequency ω / 2π; 0: none.
  double damping = 0.0, share = 1.0;
  bool operator==(const Mode&) const = default;
};

/// q in time. Exact while its drive goes as a cubic; 0 < damping < 1.
class Resonance {
 public:
  /// It has gone along with the drive's rate for long.
  Resonance(const Mode& mode, const DriveMotion& drive);

  /// dt later, the drive's angle and rate meanwhile having gone from one to the other.
  void advance(double dt_s, const DriveMotion& from, const DriveMotion& to);
  [[nodiscard]] double angle_rad() const { return angle_; }

 private:
  /// Of the homogeneous equation after dt: a regular log has few lengths.
  struct Swing {
    double dt_s = -1.0, decay = 1.0, cosine = 1.0, sine = 0.0;
  };
  const Swing& swing_over(double dt_s);

  double omega_, damping_, damped_omega_;
  double angle_, rate_;
  std::array<Swing, 2> known_{};
};

}  // namespace alidade
