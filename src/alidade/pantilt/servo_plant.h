#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <optional>
#include <string_view>
#include <variant>

#include "alidade/public.h"

// How one axis of a head follows its command; docs/maths/servo.md. Angles inside are radians; the gain of a plant
// speaks of the unit that stands beside it, because a gain without its unit has been misread before.

namespace alidade {
ALIDADE_PUBLIC_BEGIN

enum class AngleUnit { deg, rad };
[[nodiscard]] double radians_in(AngleUnit unit);  ///< π/180, or 1.
[[nodiscard]] std::string_view unit_name(AngleUnit unit);
[[nodiscard]] std::optional<AngleUnit> unit_named(std::string_view name);

/// An axis whose angle follows the command with a first-order lag, no faster than it can: dθ = clamp((g u − θ) / τ,
/// ±max_rate). With a limit of its acceleration it is the axis of docs/maths/servo.md, "A head with position
/// commands": the rate follows within that limit, and brakes in time.
struct AnglePlant {
  double gain = 0.0567;  ///< Angle per unit of command, in `unit`. Xiahou, Chen & Wu, 2015: 0.0567 / (0.1 s + 1).
  AngleUnit unit = AngleUnit::deg;
  double tau_s = 0.1;
  double max_rate_rad_s = std::numeric_limits<double>::infinity();
  double max_acceleration_rad_s2 = std::numeric_limits<double>::infinity();

  [[nodiscard]] double gain_rad() const { return gain * radians_in(unit); }
  bool operator==(const AnglePlant&) const = default;
};

/// An axis whose rate follows the command with a first-order lag, no faster and no harder than it can:
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
  double command_delay_s = 0.0;  ///< From a command to its first effect.
  double dead_band = 0.0;        ///< Commands no larger do nothing, larger ones count from it. In units of command.
  double backlash_rad = 0.0;     ///< Play between what drives the axis and the axis itself.
  double second_tau_s = 0.0;     ///< A first-order lag of the command, before the plant.
  bool operator==(const ServoAxis&) const = default;
};

/// A command after the dead band.
[[nodiscard]] double past_dead_band(double command, double dead_band);
/// The axis without dead band, backlash and second lag: the model of a linear controller.
[[nodiscard]] ServoAxis linear_part(const ServoAxis& axis);

struct AxisMotion {
  double angle_rad = 0.0;
  double rate_rad_s = 0.0;  ///< Of an angle plant without a limit of its acceleration: mean over the last step.
};

/// The plant of an axis dt ≥ 0 later under a constant command that acts at once. Closed form, exact for any dt, for an
/// angle plant with a limit of its acceleration piece by piece (`advance_drive`). At a stop the axis stands
/// still.
[[nodiscard]] AxisMotion advanced(const ServoAxis& axis, const AxisMotion& motion, double command, double dt_s);

/// A plant behind a first-order lag of its command, and the command behind that lag.
struct LaggedMotion {
  AxisMotion motion;
  double lagged = 0.0;
};
/// It dt ≥ 0 later under a constant command that acts at once, without limits of rate and acceleration. Closed form.
[[nodiscard]] LaggedMotion advanced_behind_lag(const ServoPlant& plant, double lag_s, const LaggedMotion& from,
                                               double command, double dt_s);

[[nodiscard]] double tau_of(const ServoPlant& plant);
/// Angle (or rate) per unit of command. [rad, rad/s]
[[nodiscard]] double gain_of(const ServoPlant& plant);
/// The same plant with gain and time constant multiplied: the true plant under a model mismatch.
[[nodiscard]] ServoPlant scaled(const ServoPlant& plant, double gain_factor, double tau_factor);

/// A simulated axis with its command delay: pending commands are queued. Allocates nothing.
/// Exact; a second lag of an axis with limits, stops or backlash is stepped through to 10⁻⁴ of it.
class DelayedAxis {
 public:
  DelayedAxis(const ServoAxis& axis, const AxisMotion& motion) : axis_(axis), motion_(motion), driven_(motion) {}

  /// Queues a command, to act after the axis's delay. Of more than 32 pending ones the oldest acts at once.
  void send(double command);
  /// `added` is added to every command meanwhile.
  void advance(double dt_s, double added = 0.0);
  [[nodiscard]] const AxisMotion& motion() const { return driven_; }
  /// At that motion, in the centre of its backlash, the second lag settled.
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
  AxisMotion motion_;     ///< Of what drives it.
  AxisMotion driven_;     ///< Behind the play.
  double lagged_ = 0.0;   ///< The command behind the second lag.
  double command_ = 0.0;  ///< That acts now.
  std::array<Waiting, 32> waiting_{};
  std::size_t num_waiting_ = 0;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
