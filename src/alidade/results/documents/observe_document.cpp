#include "alidade/results/documents/observe_document.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/formats/camera_json.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/report/thin.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

/// Which rows stand in the table: intrinsics.csv has all.
std::vector<bool> kept_rows(const ObserveReport& report) {
  std::vector<bool> has_event, kept(report.steps.size(), false);
  Numbers nis;
  for (const IntrinsicsEstimate& step : report.steps) {
    has_event.push_back(step.event != ObserveEvent::none);
    nis.push_back(step.nis_dof > 0 ? step.nis / step.nis_dof : not_seen);
  }
  for (const std::size_t row : report::thinned_rows(kept.size(), {nis}, has_event, report::max_step_rows))
    kept[row] = true;
  return kept;
}

/// Values over time, the event, and where the camera looked.
class StepColumns {
 public:
  void add(const ObserveStep& row);
  [[nodiscard]] DataTable table() const;

 private:
  Numbers t_, nis_, nis_dof_, weak_, event_point_;
  std::array<Numbers, 4> value_, sigma_, truth_, attitude_;
  std::array<Numbers, 3> rate_;
  std::vector<std::string> events_;
};

void StepColumns::add(const ObserveStep& row) {
  const IntrinsicsEstimate& step = row.estimate;
  t_.push_back(row.t_s);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    value_[i].push_back(step.has_value ? step.values()[at] : not_seen);
    sigma_[i].push_back(step.has_value ? step.sigma[at] : not_seen);
    if (row.truth) truth_[i].push_back((*row.truth)[i]);
    attitude_[i].push_back(row.start_from_cam.coeffs()[at]);
  }
  for (std::size_t i = 0; i < 3; ++i) rate_[i].push_back(row.rate_rad_per_s[static_cast<Eigen::Index>(i)]);
  nis_.push_back(step.nis_dof > 0 ? step.nis : not_seen);
  nis_dof_.push_back(step.nis_dof);
  weak_.push_back(step.has_value ? 1.0 / step.sigma.cwiseAbs2().maxCoeff() : not_seen);
  events_.emplace_back(event_name(step.event));
  event_point_.push_back(step.point >= 0 ? step.point : not_seen);
}

DataTable StepColumns::table() const {
  constexpr std::array<const char*, 4> names{"fx", "fy", "cx", "cy"}, quaternion{"qx", "qy", "qz", "qw"};
  constexpr std::array<const char*, 3> axes{"x", "y", "z"};
  DataTable table{"steps", {{"t_s", t_}}};
  const auto add = [&](const std::string& name, const Numbers& values, int decimals) {
    table.columns.emplace_back(name, rounded(values, decimals));
  };
  for (std::size_t i = 0; i < 4; ++i) add(std::string(names[i]) + "_px", value_[i], 5);
  for (std::size_t i = 0; i < 4; ++i) add(std::string("sigma_") + names[i] + "_px", sigma_[i], 6);
  for (std::size_t i = 0; i < 4 && !truth_[0].empty(); ++i)
    table.columns.emplace_back(std::string("truth_") + names[i] + "_px", truth_[i]);
  add("nis", nis_, 4);
  table.columns.emplace_back("nis_dof", nis_dof_);
  table.columns.emplace_back("event", events_);
  table.columns.emplace_back("event_point", event_point_);
  table.columns.emplace_back("weak_eigenvalue", weak_);
  for (std::size_t i = 0; i < 3; ++i) add(std::string("omega_") + axes[i] + "_rad_per_s", rate_[i], 8);
  for (std::size_t i = 0; i < 4; ++i) add(std::string("start_from_cam_") + quaternion[i], attitude_[i], 8);
  return table;
}

DataTable steps_table(const ObserveReport& report) {
  const RotationLog& log = report.log;
  MotionReader reader(log.source, 0.25);
  const std::vector<bool> is_kept = kept_rows(report);
  StepColumns columns;
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const RotationFrame frame = reader.next(log.rows[k]);
    if (!is_kept[k]) continue;
    ObserveStep step = step_of(frame, report.steps[k]);
    if (!log.truth.empty()) step.truth = log.truth[k];
    columns.add(step);
  }
  DataTable table = columns.table();
  record_steps_kept(table, log.rows.size(), "nis per degree of freedom", "intrinsics.csv");
  return table;
}

/// Residuals, prediction minus pixel. `step` is a row of the log.
DataTable points_table(const ObserveReport& report) {
  std::vector<int> step, point;
  Numbers u, v, du, dv;
  for (const ObserveResidual& seen : report.residuals) {
    step.push_back(seen.row);
    point.push_back(seen.point);
    u.push_back(seen.px.x());
    v.push_back(seen.px.y());
    du.push_back(seen.residual_px.x());
    dv.push_back(seen.residual_px.y());
  }
  return {"points",
          {{"step", step},
           {"point", point},
           {"u_px", rounded(u, 2)},
           {"v_px", rounded(v, 2)},
           {"residual_u_px", rounded(du, 4)},
           {"residual_v_px", rounded(dv, 4)}}};
}

bool is_of_camera(const std::string& name) {
  static constexpr std::array names{"fx", "fy", "cx", "cy", "k1", "k2", "k3", "p1", "p2"};
  return std::find(names.begin(), names.end(), name) != names.end();
}

/// The bound is of the longest time without a zoom alone: σ, which includes the other rows as well, may be smaller.
void fill_reference(const ObserveReport& report, JsonValue& bound) {
  const RotationLog& log = report.log;
  const double from_s = log.rows.front().t_s, until_s = log.rows.back().t_s;
  const double first_s = std::max(from_s, report.reference_from_s),
               last_s = std::min(until_s, report.reference_until_s);
  constexpr double nearly_all = 0.9;
  if (!(last_s - first_s < nearly_all * (until_s - from_s))) return;
  bound["from_s"] = first_s;
  bound["until_s"] = last_s;
}

void fill_values(const ObserveReport& report, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["camera"] = camera_values(report.camera);
  for (const ObservedQuantity& quantity : report.quantities) {
    if (is_of_camera(quantity.name)) {
      document.stddev["camera"][quantity.name] = quantity.sigma;
      document.stddev_model["camera"][quantity.name] = quantity.sigma_model;
    } else {
      estimate[quantity.name] = quantity.value;
      document.stddev[quantity.name] = quantity.sigma;
      document.stddev_model[quantity.name] = quantity.sigma_model;
    }
    estimate["bound"][quantity.name] = quantity.bound;
    document.covariance_names.push_back(is_of_camera(quantity.name) ? "camera." + quantity.name : quantity.name);
  }
  for (Eigen::Index i = 0; i < report.covariance.rows(); ++i) {
    for (Eigen::Index j = i; j < report.covariance.cols(); ++j) {
      document.covariance_upper.push_back(report.covariance(i, j));
    }
  }
}

/// The difference of the stated σ from the model's, and what was tested.
void fill_errors(const ObserveReport& report, ResultDocument& document) {
  document.assumed = report.assumed;
  JsonValue& shared = document.estimate["shared_errors"];
  shared["design_effect"] = report.shared_errors.design_effect;
  shared["correlation_s"] = report.shared_errors.correlation_s;
  shared["block_s"] = report.shared_errors.block_s;
  shared["track_effect"] = report.shared_errors.track_effect;
  JsonValue causes = JsonValue::list();
  for (const TestedCause& cause : report.tested_causes) {
    JsonValue each = JsonValue::object();
    each["name"] = cause.name;
    each["z"] = cause.z;
    JsonValue members = JsonValue::list();
    for (const TestedCause::Value& member : cause.values) {
      JsonValue value = JsonValue::object();
      value["name"] = member.name;
      value["value"] = member.value;
      value["sigma"] = member.sigma;
      value["unit"] = member.unit;
      members.push_back(std::move(value));
    }
    each["members"] = std::move(members);
    causes.push_back(std::move(each));
  }
  document.estimate["causes"] = std::move(causes);
}

/// How the rotation was measured; σ of angles null: it was not.
JsonValue rotation_value(const ObserveReport& report) {
  JsonValue rotation = JsonValue::object();
  rotation["source"] = source_name(report.log.source);
  rotation["sigma_angle_rad"] = report.sigma_angle_rad;
  rotation["sigma_rate_rad_per_s"] = report.sigma_rate_rad_per_s;
  return rotation;
}

JsonValue events_list(const ObserveReport& report) {
  JsonValue events = JsonValue::list();
  for (const ObserveNote& note : report.events) {
    JsonValue event = JsonValue::object();
    event["t_s"] = note.t_s;
    event["kind"] = event_name(note.event);
    if (note.point >= 0) event["point"] = note.point + 1;
    events.push_back(std::move(event));
  }
  return events;
}

JsonValue photos_list(const ObserveReport& report) {
  JsonValue list = JsonValue::list();
  for (std::size_t i = 0; i < report.photos.size(); ++i) {
    const RotatedPhoto& photo = report.photos[i];
    JsonValue row = JsonValue::object();
    row["file"] = report.photo_names[i];
    row["used"] = photo.is_used;
    row["reason"] = photo.reason;
    row["points"] = photo.num_points;
    if (photo.is_used) {
      row["rms_px"] = photo.rms_px;
      row["turn_rad"] = photo.turn_rad;
      row["zoom"] = photo.zoom;
      row["sigma_zoom"] = photo.sigma_zoom;
    }
    list.push_back(std::move(row));
  }
  return list;
}

DataTable photos_table(const ObserveReport& report) {
  std::vector<std::string> reasons;
  std::vector<bool> used;
  std::vector<int> points;
  std::vector<double> rms, z2;
  for (const RotatedPhoto& photo : report.photos) {
    used.push_back(photo.is_used);
    reasons.push_back(photo.reason);
    points.push_back(photo.num_points);
    rms.push_back(photo.is_used ? photo.rms_px : not_seen);
    z2.push_back(photo.is_used && photo.z2 > 0.0 ? photo.z2 : not_seen);
  }
  return {"photos",
          {{"name", report.photo_names},
           {"used", used},
           {"reason", reasons},
           {"points", points},
           {"rms_px", rms},
           {"cluster_z2", z2}}};
}

/// What only photos have; and they have no clock: what a log has by the second says nothing.
void fill_photos(const ObserveReport& report, ResultDocument& document) {
  for (DataTable& table : document.data) {
    if (table.name != "steps") continue;
    std::erase_if(table.columns, [](const auto& column) {
      return column.first.starts_with("omega_") || column.first == "weak_eigenvalue";
    });
  }
  document.data.insert(document.data.begin(), photos_table(report));
  document.estimate["photos"] = photos_list(report);
  JsonValue& matches = document.estimate["matches"];
  matches["given"] = report.matches.given;
  matches["agree_within_pairs"] = report.matches.agreeing;
  matches["kept"] = report.matches.kept;
  if (report.status != ObserveReport::Status::ok) return;
  JsonValue& parallax = document.estimate["parallax"];
  parallax["z"] = report.parallax.z;
  parallax["rms_px"] = report.parallax.rms_px;
  parallax["share_of_distance"] = report.parallax.relative;  // a radian of rotation
}

}  // namespace

DataTable observe_row(const ObserveStep& step) {
  StepColumns columns;
  columns.add(step);
  return columns.table();
}

void fill_observation(const ObserveReport& report, ResultDocument& document) {
  const RotationLog& log = report.log;
  document.counts = report.counts;
  if (report.status == ObserveReport::Status::ok) {
    fill_values(report, document);
    fill_errors(report, document);
    document.estimate["rotation"] = rotation_value(report);
    if (!log.rows.empty()) fill_reference(report, document.estimate["bound"]);
  }
  document.estimate["events"] = events_list(report);
  document.estimate["sigma_px"] = report.sigma_px;
  document.estimate["sigma_px_from"] = report.sigma_is_estimated ? "residuals" : "given";
  if (!log.truth.empty() && report.status == ObserveReport::Status::ok) {
    const std::vector<std::string> names{"fx", "fy", "cx", "cy"};
    for (std::size_t i = 0; i < 4; ++i) {
      document.estimate["error"][names[i]] = report.quantities[i].value - log.truth.back()[i];
    }
  }
  if (report.steps.size() == log.rows.size() && !log.rows.empty()) document.data.push_back(steps_table(report));
  if (!report.residuals.empty()) document.data.push_back(points_table(report));
  if (!report.photos.empty()) fill_photos(report, document);
}

}  // namespace alidade
