#include "alidade/fleet/fleet_camera.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/fleet/fleet_learning.h"
#include "alidade/fleet/fleet_model.h"
#include "alidade/fleet/fleet_reading.h"
#include "alidade/fleet/fleet_tracking.h"

namespace alidade {
namespace {

constexpr int frozen_rows = 5;                      // the same pixels so often, while the camera rotated
constexpr double turned_px = 3.0;                   // by so much that they would have moved
constexpr double fresh_s = 3600.0;                  // an alarm is in the verdict for so long
constexpr double max_rad = 4.0 * std::numbers::pi;  // of an angle, as observe has it: two turns
constexpr double max_rad_s = 100.0;                 // of a rate
constexpr double max_c = 1e3;                       // of a temperature
constexpr double degree = std::numbers::pi / 180.0;

/// Pixels far outside the image are none.
FleetRow believable(const FleetRow& row, const FleetConfig& config) {
  FleetRow kept = row;
  for (std::size_t i = 0; i < kept.px.size(); i += 2) {
    const bool is_near =
        std::abs(kept.px[i]) < 4.0 * config.width_px && std::abs(kept.px[i + 1]) < 4.0 * config.height_px;
    const bool is_there = std::isfinite(kept.px[i]) && std::isfinite(kept.px[i + 1]);
    if (is_there && !is_near) kept.in_part = FleetFault::pixel;
    if (!is_near) kept.px[i] = kept.px[i + 1] = std::numeric_limits<double>::quiet_NaN();
  }
  return kept;
}

void note_row(const FleetRow& row, const FleetRotation& rotation, FleetCamera& camera) {
  const Eigen::Quaterniond q(rotation.before);
  camera.attitude = {q.w(), q.x(), q.y(), q.z()};
  camera.rate = {row.rotation[0], row.rotation[1], row.rotation[2]};
  camera.has_row = 1;
  camera.t_s = row.t_s;
  if (std::abs(row.temperature_c) < max_c) camera.temperature_c = static_cast<float>(row.temperature_c);
  for (std::size_t i = 0; i < camera.px.size(); ++i) camera.px[i] = static_cast<float>(row.px[i]);
}

/// All pixels are those of the row before, bit by bit, and at least one is there.
bool is_same_image(const FleetCamera& camera, const FleetRow& row) {
  bool is_any = false;
  for (std::size_t i = 0; i < 2 * static_cast<std::size_t>(camera.num_points); ++i) {
    const auto now = static_cast<float>(row.px[i]);
    if (std::isnan(now) && std::isnan(camera.px[i])) continue;
    if (now != camera.px[i]) return false;
    is_any = true;
  }
  return is_any;
}

double turn_between(const FleetCamera& camera, const FleetRotation& rotation) {
  const auto& q = camera.attitude;
  return Eigen::Quaterniond(q[0], q[1], q[2], q[3]).angularDistance(Eigen::Quaterniond(rotation.before));
}

/// An image that does not change while the camera rotates contains nothing, and is reported once.
std::optional<FleetAlarm> watch_image(FleetCamera& camera, const FleetRow& row, const FleetRotation& rotation,
                                      const FleetConfig& config, bool& is_frozen) {
  is_frozen = false;
  if (camera.has_row == 0 || !is_same_image(camera, row)) {
    camera.num_frozen = 0;
    return std::nullopt;
  }
  is_frozen = camera.num_frozen > 0 || turn_between(camera, rotation) * config.width_px > turned_px;
  if (!is_frozen) return std::nullopt;
  if (camera.num_frozen == 0) camera.frozen_since_s = camera.t_s;
  if (camera.num_frozen < 60000) ++camera.num_frozen;
  if (camera.num_frozen != frozen_rows) return std::nullopt;
  const double duration_s = row.t_s - camera.frozen_since_s;
  return FleetAlarm{FleetAlarmKind::frozen, row.n, row.t_s, duration_s, duration_s / frozen_rows,
                    camera.frozen_since_s};
}

/// Without its size: of a verdict.
const char* what_happened(FleetAlarmKind kind) {
  switch (kind) {
    case FleetAlarmKind::pan_zero:
      return "the zero of pan moved";
    case FleetAlarmKind::tilt_zero:
      return "the zero of tilt moved";
    case FleetAlarmKind::focal_length:
      return "the focal length changed";
    case FleetAlarmKind::frozen:
      return "the image was frozen";
    case FleetAlarmKind::lost:
      return "the points did not fit";
    case FleetAlarmKind::focal_temperature:
      return "the focal length drifts with temperature";
    case FleetAlarmKind::none:
      break;
  }
  return "nothing happened";
}

/// A camera that does not fit for a minute of rows is reinitialised.
std::optional<FleetAlarm> watch_fit(FleetCamera& camera, const FleetRow& row) {
  if (camera.num_gated < lost_rows) return std::nullopt;
  camera.phase = FleetPhase::learning;
  camera.body.learning = {};
  camera.num_buffered = camera.num_gated = 0;
  camera.stride = 1;
  camera.since_kept = 0;
  return FleetAlarm{FleetAlarmKind::lost, row.n, row.t_s, static_cast<double>(lost_rows), 1.0, row.t_s};
}

/// What a camera is, but for a last row that says nothing.
Verdict verdict_of_state(const FleetCamera& camera) {
  Verdict verdict;
  if (camera.num_frozen >= frozen_rows) {
    verdict.state = State::bad;
    verdict.sentence = "the image is frozen";
  } else if (camera.phase == FleetPhase::learning) {
    verdict.state = State::refused;
    verdict.sentence = camera.stride > 1 || camera.misread != 0
                           ? undetermined_sentence(camera)
                           : fmt::format("learning: {} of {} rows", camera.num_buffered, fleet_learning_rows);
  } else if (camera.num_gated > frozen_rows) {
    verdict.state = State::bad;
    verdict.sentence = fmt::format("the last {} rows do not fit the camera", camera.num_gated);
  } else if (camera.last_alarm != FleetAlarmKind::none && camera.t_s - camera.alarm_t_s < fresh_s) {
    verdict.state = State::care;
    verdict.sentence =
        fmt::format("{}, said at {:.1f} s, and followed since", what_happened(camera.last_alarm), camera.alarm_t_s);
  } else {
    verdict.sentence = "as it was learned";
  }
  return verdict;
}

}  // namespace

FleetFault fault_of(const FleetCamera& camera, const FleetRow& row) {
  const double most = row.source == FleetSource::rate ? max_rad_s : max_rad;
  const auto& r = row.rotation;
  const double length2 = r[0] * r[0] + r[1] * r[1] + r[2] * r[2] + r[3] * r[3];
  if (!std::isfinite(row.t_s)) return FleetFault::time;
  if (!std::ranges::all_of(r, [](double each) { return std::isfinite(each); })) return FleetFault::rotation;
  if (std::ranges::any_of(r, [most](double each) { return std::abs(each) > most; })) return FleetFault::too_large;
  if (row.source == FleetSource::attitude && !(length2 > 0.0)) return FleetFault::rotation;
  return camera.has_row != 0 && row.source != camera.source ? FleetFault::another_rotation : FleetFault::none;
}

bool says_nothing(FleetFault fault) {
  return fault != FleetFault::none && fault != FleetFault::temperature && fault != FleetFault::pixel;
}

const char* sentence_of(FleetFault fault) {
  switch (fault) {
    case FleetFault::time:
      return "t is not a number of seconds";
    case FleetFault::rotation:
      return "its rotation is not there, or no number: pan and tilt, qw qx qy qz, or omega_x omega_y";
    case FleetFault::too_large:
      return "its angles are more than two turns, or its rates beyond 100 rad/s: rad are expected, of degrees pan_deg "
             "and tilt_deg";
    case FleetFault::temperature:
      return "temperature_c is not a number";
    case FleetFault::pixel:
      return "a pixel is not a number, or far outside an image of the size given";
    case FleetFault::another_rotation:
      return "its rotation is of another kind than that of the first rows";
    case FleetFault::none:
      break;
  }
  return "";
}

std::optional<FleetAlarm> advance(FleetCamera& camera, const FleetRow& given, const FleetConfig& config) {
  const FleetRow row = believable(given, config);
  camera.n = row.n;
  if (camera.has_row == 0) camera.source = row.source;
  if (camera.phase == FleetPhase::learning) {
    const int num_points = std::clamp(row.num_points, static_cast<int>(camera.num_points), max_fleet_points);
    camera.num_points = static_cast<std::uint8_t>(num_points);
  }
  camera.last_fault = fault_of(camera, row);
  if (camera.last_fault == FleetFault::too_large && camera.phase == FleetPhase::learning) note_degrees(camera);
  if (camera.last_fault != FleetFault::none) return std::nullopt;
  camera.last_fault = row.in_part;
  const FleetRotation rotation = rotation_of(camera, row);
  if (!rotation.before.allFinite() || !rotation.after.allFinite()) return std::nullopt;
  bool is_frozen = false;
  std::optional<FleetAlarm> alarm = watch_image(camera, row, rotation, config, is_frozen);
  if (!is_frozen) {
    if (camera.phase == FleetPhase::learning) {
      note_row(row, rotation, camera);
      learn(camera, row, rotation, config);
    } else {
      alarm = track_row(camera, row, rotation, config);
      if (!alarm) alarm = watch_fit(camera, row);
      note_row(row, rotation, camera);
    }
  } else {
    note_row(row, rotation, camera);
  }
  if (camera.phase == FleetPhase::tracking) note_centre(camera, config);
  if (alarm) {
    camera.last_alarm = alarm->kind;
    camera.alarm_t_s = alarm->t_s;
  }
  return alarm;
}

FleetEstimate estimate_of(const FleetCamera& camera) {
  FleetEstimate estimate;
  estimate.value.setConstant(std::numeric_limits<double>::quiet_NaN());
  estimate.sigma = estimate.value;
  if (camera.phase != FleetPhase::tracking) return estimate;
  estimate.has_value = true;
  estimate.has_temperature = std::isfinite(camera.body.tracking.reference_c);
  std::size_t at = 0;
  for (Eigen::Index i = 0; i < num_fleet_common; ++i) {
    estimate.value[i] = camera.body.tracking.x[static_cast<std::size_t>(i)];
    estimate.sigma[i] = std::sqrt(camera.body.tracking.P[at]);
    at += static_cast<std::size_t>(num_fleet_common - i);
  }
  return estimate;
}

std::string kind_name(FleetAlarmKind kind) {
  switch (kind) {
    case FleetAlarmKind::pan_zero:
      return "pan_zero";
    case FleetAlarmKind::tilt_zero:
      return "tilt_zero";
    case FleetAlarmKind::focal_length:
      return "focal_length";
    case FleetAlarmKind::frozen:
      return "frozen";
    case FleetAlarmKind::lost:
      return "lost";
    case FleetAlarmKind::focal_temperature:
      return "focal_temperature";
    case FleetAlarmKind::none:
      break;
  }
  return "none";
}

std::string sentence_of(const FleetAlarm& alarm) {
  switch (alarm.kind) {
    case FleetAlarmKind::pan_zero:
    case FleetAlarmKind::tilt_zero:
      return fmt::format("the zero of {} moved by {:.3f}° ± {:.3f}° at {:.1f} s",
                         alarm.kind == FleetAlarmKind::pan_zero ? "pan" : "tilt", alarm.value / degree,
                         alarm.sigma / degree, alarm.since_s);
    case FleetAlarmKind::focal_length:
      return fmt::format("the focal length changed by {:.2f} % ± {:.2f} % at {:.1f} s", 100.0 * alarm.value,
                         100.0 * alarm.sigma, alarm.since_s);
    case FleetAlarmKind::frozen:
      return fmt::format("the image is frozen since {:.1f} s, while the camera turns", alarm.since_s);
    case FleetAlarmKind::lost:
      return "the points fit the camera no longer: it is learned again";
    case FleetAlarmKind::focal_temperature:
      return fmt::format("the focal length drifts with temperature: {:.4f} % ± {:.4f} % per °C", 100.0 * alarm.value,
                         100.0 * alarm.sigma);
    case FleetAlarmKind::none:
      break;
  }
  return "";
}

Verdict verdict_of(const FleetCamera& camera) {
  Verdict verdict = verdict_of_state(camera);
  const std::string fault = sentence_of(camera.last_fault);
  const std::string centre = camera.phase == FleetPhase::tracking ? centre_sentence(camera) : "";
  if (fault.empty() && centre.empty()) return verdict;
  if (!centre.empty()) verdict.sentence += "; " + centre;
  if (!fault.empty())
    verdict.sentence +=
        (says_nothing(camera.last_fault) ? "; the last row says nothing: " : "; of the last row ") + fault;
  if (verdict.state == State::good) verdict.state = State::care;
  return verdict;
}

}  // namespace alidade
