#pragma once

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

inline constexpr double usual_positioner_step_s = 0.25e-3;

/// The axis in time. A command acts `latency_s` after it was given; the wanted rate is the largest from which the drive
/// can brake at its acceleration, or what is left over the time constant where that is less; the rate follows it within
/// the acceleration. Integrated in steps of `step_s` that begin where a command begins to act.
class Positioner {
 public:
  Positioner(const PositionerParams& params, double start_rad, double t_s, double step_s = usual_positioner_step_s);

  /// Commands in order of time.
  void go_to(double t_s, double target_rad);
  void stop(double t_s);
  /// Nothing that is on its way acts any more; the drive brakes now.
  void cut(double t_s);
  /// Moves on to that time; never back.
  void advance(double t_s);

  [[nodiscard]] double output_rad() const { return output_; }
  [[nodiscard]] double motor_rad() const { return motor_; }
  [[nodiscard]] bool is_at_rest() const { return is_at_rest_ && waiting_.empty(); }
  [[nodiscard]] double time_s() const { return t_; }

 private:
  struct Waiting {
    double acts_s, target_rad;
    bool is_stop;
  };
  void act(const Waiting& command);
  void step(double dt_s);

  PositionerParams params_;
  std::deque<Waiting> waiting_;
  double step_s_, t_, target_, motor_, output_, rate_ = 0.0;
  bool is_at_rest_ = true, is_stopping_ = false;
};

/// A command of a log, and when it was given.
struct PositionCommand {
  double t_s = 0.0, target_rad = 0.0;
};

/// Output of an axis that rests at `start_rad`, at ascending times; between the steps in a straight line.
[[nodiscard]] std::vector<double> positioner_response(const PositionerParams& params, double start_rad,
                                                      std::span<const PositionCommand> commands,
                                                      std::span<const double> times_s,
                                                      double step_s = usual_positioner_step_s);

}  // namespace alidade
