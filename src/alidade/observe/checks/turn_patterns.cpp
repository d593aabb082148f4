#include "alidade/observe/checks/turn_patterns.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/pantilt/head_rotation.h"

namespace alidade {
namespace {

// Typical σ of instruments. Encoders: cheap servos; rates: gyroscopes of phones.
constexpr double instrument_scale = 0.02, instrument_backlash_rad = 0.5 * degree, instrument_curve_rad = 0.3 * degree,
                 instrument_zero_drift = 1e-3, instrument_bias = 0.01, instrument_clock_rate = 1e-3,
                 instrument_skew_rad = 0.2 * degree;

using Rows = std::span<RotationRow>;

/// The log's rows without their pixels.
RotationLog bare(const RotationLog& log) {
  RotationLog copy;
  copy.source = log.source;
  copy.has_roll_rate = log.has_roll_rate;
  copy.rows.resize(log.rows.size());
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    copy.rows[k].t_s = log.rows[k].t_s;
    copy.rows[k].rate_rad_per_s = log.rows[k].rate_rad_per_s;
    copy.rows[k].pan_tilt_roll_rad = log.rows[k].pan_tilt_roll_rad;
    copy.rows[k].base_from_cam = log.rows[k].base_from_cam;
  }
  return copy;
}

std::vector<Eigen::Quaterniond> turned_since_start(const RotationLog& log, double max_gap_s) {
  std::vector<Eigen::Quaterniond> turned;
  turned.reserve(log.rows.size());
  MotionReader reader(log.source, max_gap_s);
  for (const RotationRow& row : log.rows) turned.push_back(reader.next(row).cam_from_start);
  return turned;
}

/// Backlash of `width` between encoder and camera: the camera stands while the encoder crosses it, then is pushed
/// by its edge. Two in series act as one of the summed width. Negative: the encoder lags behind the camera.
void undo_backlash(Rows rows, Eigen::Index axis, double width) {
  const double half = 0.5 * std::abs(width), sign = width < 0.0 ? -1.0 : 1.0;
  constexpr double still_rad = 1e-6;  // a change of the encoder's last digit is not a motion
  double first = not_seen, way = 0.0;
  for (const RotationRow& row : rows) {
    const double angle = row.pan_tilt_roll_rad[axis];
    if (!std::isfinite(angle)) continue;
    if (!std::isfinite(first)) first = angle;
    if (std::abs(angle - first) <= std::max(still_rad, 2.0 * half)) continue;
    way = angle > first ? 1.0 : -1.0;
    break;
  }
  double camera = first - half * way;  // as if it had been rotating in this direction before the log began
  for (RotationRow& row : rows) {
    double& angle = row.pan_tilt_roll_rad[axis];
    if (!std::isfinite(angle)) continue;
    camera = std::clamp(camera, angle - half, angle + half);
    angle += sign * (camera - angle);
  }
}

/// Value at `late_s` after `now`, by the parabola through three rows.
Eigen::Vector3d later(const Eigen::Vector3d& before, const Eigen::Vector3d& now, const Eigen::Vector3d& after,
                      double h0, double h, double late_s) {
  const Eigen::Vector3d slope0 = (now - before) / h0, slope = (after - now) / h;
  const Eigen::Vector3d rate = (h * slope0 + h0 * slope) / (h0 + h), half_acceleration = (slope - slope0) / (h0 + h);
  return now + late_s * (rate + late_s * half_acceleration);
}

/// The clock of the rotation runs at another rate than that of the images: each row gets the
/// rotation that was measured `amount` later per second since the midpoint of the log, and rates
/// are scaled likewise, as a rotation is rate × time. The first and the last row are not shifted.
void undo_clock_rate(Rows rows, double amount) {
  for (RotationRow& row : rows) row.rate_rad_per_s *= 1.0 + amount;
  if (rows.size() < 3) return;
  const std::vector<RotationRow> as_read(rows.begin(), rows.end());
  const double mid_s = 0.5 * (as_read.front().t_s + as_read.back().t_s);
  for (std::size_t k = 1; k + 1 < rows.size(); ++k) {
    const RotationRow &before = as_read[k - 1], &now = as_read[k], &after = as_read[k + 1];
    const double h0 = now.t_s - before.t_s, h = after.t_s - now.t_s, late_s = amount * (now.t_s - mid_s);
    if (!(h0 > 0.0) || !(h > 0.0)) continue;
    const auto shift = [&](Eigen::Vector3d RotationRow::*value) {
      const Eigen::Vector3d shifted = later(before.*value, now.*value, after.*value, h0, h, late_s);
      if (shifted.allFinite()) rows[k].*value = shifted;  // a neighbouring row may lack a measurement
    };
    shift(&RotationRow::pan_tilt_roll_rad);
    shift(&RotationRow::rate_rad_per_s);
    if (before.base_from_cam.norm() < 0.5 || now.base_from_cam.norm() < 0.5 || after.base_from_cam.norm() < 0.5)
      continue;
    const auto turn_to = [&](const RotationRow& row) {
      return Eigen::Vector3d(log_so3((now.base_from_cam.conjugate() * row.base_from_cam).normalized()));
    };
    const Eigen::Vector3d turn = later(turn_to(before), Eigen::Vector3d::Zero(), turn_to(after), h0, h, late_s);
    rows[k].base_from_cam = now.base_from_cam * exp_so3(turn);
  }
}

void add_clock_error(std::vector<RotationError>& errors) {
  errors.push_back({"clock rate", "clock rate", "", "clock_rate", instrument_clock_rate, 1e-4, undo_clock_rate});
}

std::string with_axis(const char* name, const char* axis, const char* unit) {
  return std::string(name) + "_" + axis + (*unit == '\0' ? "" : "_") + unit;
}

/// Pan, tilt and roll of a head with perpendicular axes for the same orientation. See base_from_cam_rotation().
Eigen::Vector3d pan_tilt_roll_of(const Eigen::Matrix3d& base_from_cam) {
  const Eigen::Vector3d view = base_from_cam.col(2);
  const double pan = std::atan2(-view.x(), view.z()), tilt = std::asin(std::clamp(-view.y(), -1.0, 1.0));
  const Eigen::Matrix3d rolled =
      base_from_cam_rotation({pan, tilt, 0.0}).toRotationMatrix().transpose() * base_from_cam;
  return {pan, tilt, std::atan2(rolled(1, 0), rolled(0, 0))};
}

/// The tilt axis is rotated by `amount` about the view, away from perpendicular to the pan axis.
void undo_skew(Rows rows, double amount) {
  for (RotationRow& row : rows) {
    Eigen::Vector3d& angles = row.pan_tilt_roll_rad;
    if (angles.allFinite()) angles = pan_tilt_roll_of(base_from_cam_rotation(angles, amount).toRotationMatrix());
  }
}

void add_head_errors(std::vector<RotationError>& errors) {
  errors.push_back(
      {"axes that are not perpendicular", "tilt axis", "rad", "axes_skew_rad", instrument_skew_rad, 1e-6, undo_skew});
  static constexpr const char* axes[] = {"pan", "tilt"};
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const char* name = axes[axis];
    const std::string member = std::string("of ") + name;
    errors.push_back({"encoder scale", member, "", with_axis("scale", name, ""), instrument_scale, 1e-5,
                      [axis](Rows rows, double amount) {
                        for (RotationRow& row : rows) row.pan_tilt_roll_rad[axis] *= 1.0 + amount;
                      }});
    errors.push_back({"zero that drifts", member, "rad/s", with_axis("zero_drift", name, "rad_per_s"),
                      instrument_zero_drift, 1e-6, [axis](Rows rows, double amount) {
                        for (RotationRow& row : rows) {
                          row.pan_tilt_roll_rad[axis] += amount * (row.t_s - rows.front().t_s);
                        }
                      }});
    // A step wider than the noise of encoders: their flicker at a turning point is not a reversal.
    errors.push_back({"backlash", member, "rad", with_axis("backlash", name, "rad"), instrument_backlash_rad, 2e-4,
                      [axis](Rows rows, double amount) { undo_backlash(rows, axis, amount); }});
    const auto add_curve = [&](const char* word, const char* short_word, double (*of)(double), double times) {
      errors.push_back({"error of the angles within a turn", std::string(word) + " " + member, "rad",
                        std::string("curve_") + short_word + "_" + name + "_rad", instrument_curve_rad, 1e-6,
                        [axis, of, times](Rows rows, double amount) {
                          for (RotationRow& row : rows) {
                            row.pan_tilt_roll_rad[axis] += amount * of(times * row.pan_tilt_roll_rad[axis]);
                          }
                        }});
    };
    const auto sine = [](double a) { return std::sin(a); };
    const auto cosine = [](double a) { return std::cos(a); };
    add_curve("sin", "sin", sine, 1.0);
    add_curve("cos", "cos", cosine, 1.0);
    add_curve("sin 2×", "sin2", sine, 2.0);
    add_curve("cos 2×", "cos2", cosine, 2.0);
  }
}

void add_rate_errors(bool has_roll_rate, std::vector<RotationError>& errors) {
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (Eigen::Index axis = 0; axis < (has_roll_rate ? 3 : 2); ++axis) {
    errors.push_back({"scale of the rates", std::string("of ω_") + axes[axis], "", with_axis("scale", axes[axis], ""),
                      instrument_scale, 1e-5, [axis](Rows rows, double amount) {
                        for (RotationRow& row : rows) row.rate_rad_per_s[axis] *= 1.0 + amount;
                      }});
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    errors.push_back({"bias of the rates", std::string("of ω_") + axes[axis], "rad/s",
                      with_axis("bias", axes[axis], "rad_per_s"), instrument_bias, 1e-6,
                      [axis](Rows rows, double amount) {
                        for (RotationRow& row : rows) row.rate_rad_per_s[axis] += amount;
                      }});
  }
}

void add_attitude_errors(std::vector<RotationError>& errors) {
  static constexpr const char* axes[] = {"x", "y", "z"};
  for (int axis = 0; axis < 3; ++axis) {
    errors.push_back({"attitude that drifts", std::string("about ") + axes[axis], "rad/s",
                      with_axis("attitude_drift", axes[axis], "rad_per_s"), instrument_zero_drift, 1e-6,
                      [axis](Rows rows, double amount) {
                        for (RotationRow& row : rows) {
                          const double turn_rad = amount * (row.t_s - rows.front().t_s);
                          row.base_from_cam = exp_so3(turn_rad * Eigen::Vector3d::Unit(axis)) * row.base_from_cam;
                        }
                      }});
  }
}

}  // namespace

std::vector<RotationError> rotation_errors(RotationSource source, bool has_roll_rate) {
  std::vector<RotationError> errors;
  if (source == RotationSource::head) add_head_errors(errors);
  if (source == RotationSource::rate) add_rate_errors(has_roll_rate, errors);
  if (source == RotationSource::attitude) add_attitude_errors(errors);
  if (source != RotationSource::none) add_clock_error(errors);
  return errors;
}

/// Numerical differentiation: the rotations are smooth functions of the measured values.
std::vector<TurnPattern> turn_patterns(const RotationLog& log, const std::vector<RotationError>& errors,
                                       double max_gap_s) {
  if (log.rows.empty() || errors.empty()) return {};
  const RotationLog as_it_is = bare(log);
  const std::vector<Eigen::Quaterniond> measured = turned_since_start(as_it_is, max_gap_s);
  std::vector<TurnPattern> patterns;
  for (const RotationError& error : errors) {
    RotationLog off = as_it_is;
    error.undo(off.rows, error.derivative_step);
    const std::vector<Eigen::Quaterniond> turned = turned_since_start(off, max_gap_s);
    TurnPattern pattern{error, {}};
    pattern.turn_rad.reserve(turned.size());
    for (std::size_t k = 0; k < turned.size(); ++k) {
      const Eigen::Quaterniond turn = (turned[k] * measured[k].conjugate()).normalized();
      pattern.turn_rad.emplace_back(log_so3(turn) / error.derivative_step);
    }
    patterns.push_back(std::move(pattern));
  }
  return patterns;
}

std::vector<TurnPattern> turn_patterns(const RotationLog& log, double max_gap_s) {
  return turn_patterns(log, rotation_errors(log.source, log.has_roll_rate), max_gap_s);
}

}  // namespace alidade
