#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/pantilt/positioner.h"
#include "alidade/servo/identification.h"

namespace alidade {

/// An angle that was read, at the midpoint of request and reply, which were so far apart.
struct PositionerReading {
  double t_s = 0.0, wait_s = 0.0, angle_rad = 0.0;
};

/// How one axis went where it was commanded.
struct PositionerLog {
  std::vector<PositionCommand> commands;
  std::vector<double> command_waits_s;  ///< How long the answers to commands took.
  std::vector<PositionerReading> readings;
  double used_from_s = -1e300;  ///< Readings before it are not used: the drive's play was not known.
  double used_until_s = 1e300;
  double largest_ignored_rad = 0.0;                ///< Of small steps at rest; 0: none was.
  std::optional<double> smallest_obeyed_rad = {};  ///< None: it was not tried.
  std::vector<double> repeated_rad = {};           ///< Where the same command from the same side ended.
};

/// One property of an axis.
struct PositionerValue {
  double value = 0.0, sigma = 0.0;
  bool is_asked_for = true;  ///< The readings are worse explained without it.
  double evidence = 0.0;     ///< By how much: 2 ln of the likelihood ratio.
};

inline constexpr std::size_t num_positioner_values = 8;
inline constexpr std::array<const char*, num_positioner_values> positioner_value_names{
    "rate_rad_s",   "acceleration_rad_s2", "time_constant_s", "latency_s",
    "backlash_rad", "dead_band_rad",       "resolution_rad",  "repeatability_rad"};

/// The axis as estimated from the log. `latency` is to the first motion that can be read: the encoder's own sampling is
/// in it, half of its period.
struct PositionerFit {
  enum class Status { ok, no_motion, too_few };
  Status status = Status::too_few;
  PositionerValue rate, acceleration, time_constant, latency, backlash, dead_band, resolution, repeatability;
  double offset_rad = 0.0, sigma_offset_rad = 0.0;  ///< What is read at rest less what was commanded.
  double gain = 1.0, sigma_gain = 0.0;  ///< What is read at rest for a radian commanded; −1: a mirrored axis.
  double encoder_hz = 0.0;              ///< It is read so often; 0: whenever it is asked.
  double renewal_s = 0.0;     ///< Readings are renewed so seldom, at no regular times: a cached status; 0: not seen.
  bool reads_target = false;  ///< Its reading is the commanded position, at once.
  bool reached_rate = false;  ///< The largest rate lasted for a while.
  double fastest_rad_s = 0.0;
  double noise = 1.0;                                ///< Of the residuals, over what resolution and timing explain.
  double rms_rad = 0.0;                              ///< Of the residuals.
  std::vector<double> t_s, residual_rad, model_rad;  ///< Of the readings that are used.

  [[nodiscard]] std::array<const PositionerValue*, num_positioner_values> values() const {
    return {&rate, &acceleration, &time_constant, &latency, &backlash, &dead_band, &resolution, &repeatability};
  }
};

/// Least squares of rate, acceleration, time constant, latency and backlash of a Positioner, each tested by what the
/// readings lose without it; the encoder's sampling is looked for in the residuals.
[[nodiscard]] PositionerFit fit_positioner(const PositionerLog& log);

/// The same log as `identify` reads it.
[[nodiscard]] std::vector<ServoSample> servo_samples(const PositionerLog& log);

/// The smallest change of which all readings are multiples; else the smallest change there is.
[[nodiscard]] double reading_step(const std::vector<PositionerReading>& readings);

}  // namespace alidade
