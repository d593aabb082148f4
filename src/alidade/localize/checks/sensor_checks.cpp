#include <cmath>
#include <string>

#include "alidade/geometry/degree.h"
#include "alidade/localize/checks/judge.h"
#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/path/path_doubt.h"

// Checks of other sensors, and of the scale by them.

namespace alidade {
namespace {

/// A depth sensor that is not at its given position.
void add_arm(const SensorScale& sensor, Verdict& verdict) {
  const auto three = [](const Eigen::Vector3d& each) {
    return text_of(each.x(), 2) + ", " + text_of(each.y(), 2) + ", " + text_of(each.z(), 2);
  };
  verdict.checks.push_back(
      {sensor.sensor + " arm", State::care,
       (sensor.arm_given_m > 0.0 ? "the " + sensor.sensor + " seems to stand elsewhere than --depth-arm says, at "
                                 : "the " + sensor.sensor + " seems to stand beside the camera, at ") +
           three(sensor.arm_m) + " ± " + three(sensor.sigma_arm_m) +
           " m in its frame: corrected; measure it (--depth-arm, --sigma-depth-arm)",
       sensor.arm_m.norm(), 0.0, "m", "path"});
}

/// Delay, filter or offset of a sensor's readings, as corrected.
void add_corrected(const SensorScale& sensor, Verdict& verdict) {
  constexpr double unnamed_s = 0.1;  // beside a filter: the rest of its delay
  if (std::abs(sensor.late_s) > (sensor.lag_s > 0.0 ? unnamed_s : 0.0))
    verdict.checks.push_back({sensor.sensor + " clock", State::care,
                              "the clock of the " + sensor.sensor + " is " + text_of(std::abs(sensor.late_s), 2) +
                                  " s " + (sensor.late_s > 0.0 ? "after" : "before") + " the camera's: corrected",
                              std::abs(sensor.late_s), 0.0, "s", "path"});
  if (sensor.lag_s > 0.0)
    verdict.checks.push_back({sensor.sensor + " filter", State::care,
                              "the readings of the " + sensor.sensor + " are filtered, with a time constant of " +
                                  text_of(sensor.lag_s, 2) + " s: corrected; have it read without",
                              sensor.lag_s, 0.0, "s", "path"});
  if (sensor.jump_m != 0.0)
    verdict.checks.push_back({sensor.sensor + " jump", State::care,
                              "the readings of the " + sensor.sensor + " jump by " + text_of(sensor.jump_m, 2) +
                                  " m at " + text_of(sensor.jump_s) + " s: corrected; was it set to zero, or moved?",
                              sensor.jump_m, 0.0, "m", "path"});
  if (sensor.is_drifting)
    verdict.checks.push_back({sensor.sensor + " drift", State::care,
                              "the readings of the " + sensor.sensor + " drift, by " + text_of(sensor.drift_m, 2) +
                                  " m in all: corrected; a tide, or a sensor that was not yet warm?",
                              sensor.drift_m, 0.0, "m", "path"});
  if (sensor.slip_ratio > 0.0)
    verdict.checks.push_back({sensor.sensor + " slip", State::care,
                              "the " + sensor.sensor + " slips: from " + text_of(sensor.slip_from_s) + " to " +
                                  text_of(sensor.slip_to_s) + " s its way is " + text_of(sensor.slip_ratio, 2) +
                                  " times the path's: rejected",
                              sensor.slip_ratio, 1.0, "1", "path"});
  if (!sensor.arm_m.isZero(0.0)) add_arm(sensor, verdict);
  if (sensor.offset_m != 0.0)
    verdict.checks.push_back({sensor.sensor + " offset", State::care,
                              "the readings of the " + sensor.sensor + " are " + text_of(std::abs(sensor.offset_m), 2) +
                                  " m too " + (sensor.offset_m > 0.0 ? "long" : "short") +
                                  ": corrected; its beam begins elsewhere than --beam says",
                              std::abs(sensor.offset_m), 0.0, "m", "path"});
  if (sensor.aside_rad > 0.0)
    verdict.checks.push_back({sensor.sensor + " direction", State::care,
                              "the beam of the " + sensor.sensor + " points elsewhere than --beam says, by about " +
                                  text_of(sensor.aside_rad / degree, 2) +
                                  "°: corrected; calibrate it (alidade rangefinder)",
                              sensor.aside_rad, 0.0, "rad", "path"});
}

/// Readings that are not in metres, or of another clock.
void add_readings(const SensorScale& sensor, Verdict& verdict) {
  constexpr double fast = 5.0;
  if (sensor.acceleration > fast)
    verdict.checks.push_back({sensor.sensor + " unit", State::care,
                              "by the " + sensor.sensor + " the camera accelerates " + text_of(sensor.acceleration, 2) +
                                  " times as much as --sigma-a says: are its readings in metres?",
                              sensor.acceleration, fast, "1", "path"});
  if (!sensor.unit.empty())
    verdict.checks.push_back({sensor.sensor + " unit", State::care,
                              "the readings of the " + sensor.sensor + " are in " + sensor.unit +
                                  ", not in metres, as the target shows: taken as such",
                              0.0, 0.0, "", "path"});
  constexpr double noisy = 10.0;
  if (sensor.unit.empty() && sensor.noise_factor > noisy)
    verdict.checks.push_back({sensor.sensor + " noise", State::care,
                              "what is left of the readings of the " + sensor.sensor + " is " +
                                  text_of(sensor.noise_factor, 2) +
                                  " times their σ (sigma_m, or 0.01 m): σ is enlarged for it; are they in metres?",
                              sensor.noise_factor, noisy, "1", "path"});
  add_corrected(sensor, verdict);
}

/// An error of a rangefinder without covariance that its readings do not exclude.
void add_hidden(const SensorScale& sensor, Verdict& verdict) {
  if (!(sensor.hidden_offset_rel > 0.0)) return;
  verdict.checks.push_back({sensor.sensor + " hidden offset", State::care,
                            "if all readings of the " + sensor.sensor +
                                " were 0.1 m too long (from its housing's other end, say) it would not show, and the "
                                "scale be off by " +
                                text_of(100.0 * sensor.hidden_offset_rel, 2) +
                                " %: use a beam with its covariance (alidade rangefinder), or move nearer and farther "
                                "before a flat wall",
                            sensor.hidden_offset_rel, 0.0, "1", "path"});
}

/// Why a sensor's readings do not determine the scale.
std::string unread_text(const SensorScale& sensor, const Localization& report) {
  if (sensor.sensor == "IMU") return imu_fault_text(*report.imu);
  if (sensor.is_too_fast)
    return "by the " + sensor.sensor + " the camera accelerates " + text_of(sensor.acceleration, 2) +
           " times as much as --sigma-a says: are its readings in metres? They are not used";
  return "the readings of the " + sensor.sensor + " do not determine the scale: " +
         (!sensor.is_in_time            ? "none of them is of the time of the path (t_s)"
          : sensor.sensor == "odometry" ? "too few of them, they do not fit the path, or the camera hardly moves"
          : sensor.sensor == "depth sensor"
              ? "too few of them, they do not fit the path, or the camera moves too little up and down"
              : "too few of them, or too few points around the beam that lie on a surface");
}

/// Compares the path's scale by a sensor with that by the first of them, if that one gave it, or by the target.
void add_agreement(const SensorScale& sensor, const SensorScale* first, const Localization& report, Verdict& verdict) {
  constexpr double bad_z = 6.0;
  constexpr double power_z = contradicts_from + 2.33;  // 99 %
  const ScaleDifference difference =
      first ? ScaleDifference{std::log(sensor.scale / first->scale), std::hypot(sensor.sigma_rel, first->sigma_rel)}
            : difference_from_target(sensor, report.sigma_target_scale);
  const double z = difference.sigmas();
  const std::string by = first ? "the " + first->sensor : "the target";
  const std::string percent =
      text_of(100.0 * std::abs(difference.log_ratio), 2) + " ± " + text_of(100.0 * difference.sigma, 2) + " %";
  const std::string which = first ? ""
                                  : ": one of the two is wrong (the target's size, say; its σ is --sigma-scale), and "
                                    "the path's σ includes that";
  verdict.checks.push_back(
      {sensor.sensor, state_of(z, contradicts_from, bad_z),
       z > contradicts_from ? "the path is " + percent + (difference.log_ratio > 0.0 ? " longer" : " shorter") +
                                  " by the " + sensor.sensor + " than by " + by + " (" + text_of(z, 2) + "σ)" + which
                            : "the " + sensor.sensor + " agrees with " + by + " on the scale; a difference of " +
                                  text_of(100.0 * power_z * difference.sigma, 2) + " % would show at 99 %",
       z, contradicts_from, "σ", "path"});
}

void add_rejected(const SensorScale& sensor, Verdict& verdict) {
  // A beam may meet surfaces without points in the map.
  const double many = sensor.sensor == "rangefinder" ? 0.5 : 0.2;
  const double rejected = share(sensor.num_rejected, sensor.num_used + sensor.num_rejected);
  if (rejected > many)
    verdict.checks.push_back(
        {sensor.sensor + " readings", State::care,
         text_of(100.0 * rejected, 2) + " % of the readings of the " + sensor.sensor + " are rejected", rejected, many,
         "1", "path"});
}

}  // namespace

std::string sensors_text(const Localization& report) {
  std::string text;
  double weights = 0.0;
  for (const SensorScale& each : report.sensor_scales) {
    if (!(each.sigma_rel > 0.0)) continue;
    text += (text.empty() ? "" : " and the ") + each.sensor;
    weights += 1.0 / (each.sigma_rel * each.sigma_rel);
  }
  return text + ", ± " + text_of(100.0 / std::sqrt(weights), 2) + " %";
}

void add_sensors(const Localization& report, Verdict& verdict) {
  const SensorScale* first = nullptr;
  for (const SensorScale& each : report.sensor_scales) {
    if (!(each.sigma_rel > 0.0)) {
      verdict.checks.push_back({each.sensor, State::care, unread_text(each, report), 0.0, 0.0, "", "path"});
      continue;
    }
    add_readings(each, verdict);
    if (report.is_scale_read) add_hidden(each, verdict);
    if (!report.is_scale_read || first) add_agreement(each, report.is_scale_read ? first : nullptr, report, verdict);
    add_rejected(each, verdict);
    if (first == nullptr) first = &each;
  }
}

}  // namespace alidade
