#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <variant>

#include "alidade/public.h"

// How one axis of a head follows its command; docs/maths/servo.md. All angles are in radians internally; the gain of a
// plant is stated in the unit stored beside it, because gains without a unit are easily misread.

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class AngleUnit { deg, rad };
[[nodiscard]] double radians_in(AngleUnit unit);  ///< π/180, or 1.
[[nodiscard]] std::string_view unit_name(AngleUnit unit);
[[nodiscard]] std::optional<AngleUnit> unit_named(std::string_view name);

/// An axis whose angle follows the command with a first-order lag and a rate limit: dθ = clamp((g u − θ) / τ,
/// ±max_rate). With an acceleration limit it is the axis of docs/maths/servo.md, "A head with position commands": the
/// rate changes within that limit, and the axis brakes in time.
struct AnglePlant {
  double gain = 0.0567;  ///< Angle per unit of command, in `unit`. Xiahou, Chen & Wu, 2015: 0.0567 / (0.1 s + 1).
  AngleUnit unit = AngleUnit::deg;
  double tau_s = 0.1;
  double max_rate_rad_s = std::numeric_limits<double>::infinity();
  double max_acceleration_rad_s2 = std::numeric_limits<double>::infinity();

  [[nodiscard]] double gain_rad() const { return gain * radians_in(unit); }
  bool operator==(const AnglePlant&) const = default;
};

/// An axis whose rate follows the command with a first-order lag, within limits of rate and acceleration:
/// dθ = ω, dω = (clamp(g u, ±max_rate) − ω) / τ within ±max_acceleration.
struct RatePlant {
  double gain = 1.0;  ///< Rate per unit of command, in `unit` per second.
  AngleUnit unit = AngleUnit::rad;
  double tau_s = 0.05;
  double max_rate_rad_s = 3.141592653589793;           ///< 180°/s
  double max_acceleration_rad_s2 = 26.17993877991494;  ///< 1500°/s²

  [[nodiscard]] double gain_rad() const { return gain * radians_in(unit); }
  bool operator==(const RatePlant&) const = default;
};

using ServoPlant = std::variant<AnglePlant, RatePlant>;

/// One axis of a head: its plant, stops, command delay and nonlinearities.
struct ServoAxis {
  ServoPlant plant;
  double min_rad = -std::numeric_limits<double>::infinity();
  double max_rad = std::numeric_limits<double>::infinity();
  double command_delay_s = 0.0;  ///< From a command to the start of its effect.
  double dead_band = 0.0;        ///< Smaller commands do nothing; larger ones are reduced by it. In units of command.
  double backlash_rad = 0.0;     ///< Play between the drive and the axis.
  double second_tau_s = 0.0;     ///< First-order lag of the command, before the plant.
  bool operator==(const ServoAxis&) const = default;
};

/// A command after the dead band.
[[nodiscard]] double past_dead_band(double command, double dead_band);
/// The axis without dead band, backlash and second lag: the model of linear controllers.
[[nodiscard]] ServoAxis linear_part(const ServoAxis& axis);

struct AxisMotion {
  double angle_rad = 0.0;
  double rate_rad_s = 0.0;  ///< For an angle plant without acceleration limit: mean over the last step.
};

/// State of an axis's plant after dt ≥ 0 under a constant command without delay. Closed form, exact for any dt; for an
/// angle plant with an acceleration limit piece by piece (`advance_drive`). At a stop the axis has
/// zero rate.
[[nodiscard]] AxisMotion advanced(const ServoAxis& axis, const AxisMotion& motion, double command, double dt_s);

/// State of a plant preceded by a first-order lag of its command, and the lagged command.
struct LaggedMotion {
  AxisMotion motion;
  double lagged = 0.0;
};
/// The state after dt ≥ 0 under a constant command without delay, limits of rate and acceleration ignored. Closed form.
[[nodiscard]] LaggedMotion advanced_behind_lag(const ServoPlant& plant, double lag_s, const LaggedMotion& from,
                                               double command, double dt_s);

[[nodiscard]] double tau_of(const ServoPlant& plant);
/// Angle (or rate) per unit of command. [rad, rad/s]
[[nodiscard]] double gain_of(const ServoPlant& plant);
/// The same plant with gain and time constant multiplied by factors: the true plant under a model mismatch.
[[nodiscard]] ServoPlant scaled(const ServoPlant& plant, double gain_factor, double tau_factor);

/// A simulated axis with its command delay; pending commands are queued. Allocates no memory.
/// Exact, except that a second lag of an axis with limits, stops or backlash is integrated in steps, to 10⁻⁴.
class DelayedAxis {
 public:
  DelayedAxis(const ServoAxis& axis, const AxisMotion& motion) : axis_(axis), motion_(motion), driven_(motion) {}

  /// Queues a command that takes effect after the axis's delay. Beyond 32 pending commands, the oldest acts at once.
  void send(double command);
  /// Advances by dt; `added` is added to every command during this time.
  void advance(double dt_s, double added = 0.0);
  [[nodiscard]] const AxisMotion& motion() const { return driven_; }
  /// Sets the motion, with the axis in the centre of its backlash and the second lag settled.
  void set_motion(const AxisMotion& motion) {
    motion_ = driven_ = motion;
    lagged_ = past_dead_band(command_, axis_.dead_band);
  }
  [[nodiscard]] const ServoAxis& axis() const { return axis_; }

 private:
  struct Waiting {
    double in_s, command;
  };
  void move(double dt_s, double command);
  void move_behind_lag(double dt_s, double goal);

  ServoAxis axis_;
  AxisMotion motion_;     ///< State of the drive.
  AxisMotion driven_;     ///< State of the axis, after the backlash.
  double lagged_ = 0.0;   ///< The command after the second lag.
  double command_ = 0.0;  ///< The command in effect.
  std::array<Waiting, 32> waiting_{};
  std::size_t num_waiting_ = 0;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
