#pragma once

#include <array>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include "alidade/pantilt/positioner.h"
#include "alidade/servo/identification.h"

namespace alidade {

/// An angle reading, at the midpoint of request and reply, with their distance in time.
struct PositionerReading {
  double t_s = 0.0, wait_s = 0.0, angle_rad = 0.0;
};

/// Log of one axis and its commands.
struct PositionerLog {
  std::vector<PositionCommand> commands;
  std::vector<double> command_waits_s;  ///< Response times of the commands.
  std::vector<PositionerReading> readings;
  double used_from_s = -1e300;  ///< Readings before it are not used: the side of the drive's play was unknown.
  double used_until_s = 1e300;
  double largest_ignored_rad = 0.0;                ///< Largest small step at rest without effect; 0: none.
  std::optional<double> smallest_obeyed_rad = {};  ///< None: not tested.
  std::vector<double> repeated_rad = {};           ///< Final positions for the same command from the same side.
};

/// One estimated property of an axis.
struct PositionerValue {
  double value = 0.0, sigma = 0.0;
  bool is_asked_for = true;  ///< Without it, the readings are explained significantly worse.
  double evidence = 0.0;     ///< 2 ln of the likelihood ratio.
};

inline constexpr std::size_t num_positioner_values = 8;
inline constexpr std::array<const char*, num_positioner_values> positioner_value_names{
    "rate_rad_s",   "acceleration_rad_s2", "time_constant_s", "latency_s",
    "backlash_rad", "dead_band_rad",       "resolution_rad",  "repeatability_rad"};

/// The axis as estimated from the log. `latency` is up to the first readable motion: it includes half a period of the
/// encoder's sampling.
struct PositionerFit {
  enum class Status { ok, no_motion, too_few };
  Status status = Status::too_few;
  PositionerValue rate, acceleration, time_constant, latency, backlash, dead_band, resolution, repeatability;
  double offset_rad = 0.0, sigma_offset_rad = 0.0;  ///< Reading at rest minus command.
  double gain = 1.0, sigma_gain = 0.0;              ///< Reading at rest per radian commanded; −1: a mirrored axis.
  double encoder_hz = 0.0;                          ///< Sampling rate; 0: sampled on request.
  double renewal_s = 0.0;     ///< Mean interval of irregularly renewed readings (a cached status); 0: not observed.
  bool reads_target = false;  ///< The reading jumps to the commanded position at once.
  bool reached_rate = false;  ///< The largest rate was held for some time.
  double fastest_rad_s = 0.0;
  double noise = 1.0;    ///< Of the residuals, relative to what resolution and timing explain.
  double rms_rad = 0.0;  ///< Of the residuals.
  std::vector<double> t_s, residual_rad, model_rad;  ///< Of the used readings.

  [[nodiscard]] std::array<const PositionerValue*, num_positioner_values> values() const {
    return {&rate, &acceleration, &time_constant, &latency, &backlash, &dead_band, &resolution, &repeatability};
  }
};

/// Least squares of rate, acceleration, time constant, latency and backlash of a Positioner, each tested by the loss
/// without it; the encoder's sampling is searched for in the residuals.
[[nodiscard]] PositionerFit fit_positioner(const PositionerLog& log);

/// The same log in the form that `identify` reads.
[[nodiscard]] std::vector<ServoSample> servo_samples(const PositionerLog& log);

/// The smallest change of which all readings are multiples; else the smallest change that occurs.
[[nodiscard]] double reading_step(const std::vector<PositionerReading>& readings);

}  // namespace alidade
