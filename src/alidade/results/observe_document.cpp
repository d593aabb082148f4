#include "alidade/results/observe_document.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numeric>

#include "alidade/formats/camera_json.h"
#include "alidade/report/thin.h"
#include "alidade/results/thin_tables.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

constexpr std::size_t max_steps = 2000, max_pixels = 6000;  // the page holds them; intrinsics.csv has all rows

/// Which rows stand in the table: evenly spread, and those with an event.
std::vector<bool> kept_rows(const ObserveReport& report) {
  std::vector<bool> has_event, kept(report.steps.size(), false);
  for (const IntrinsicsEstimate& step : report.steps) has_event.push_back(step.event != ObserveEvent::none);
  for (const std::size_t row : report::thinned_rows(kept.size(), {}, has_event, max_steps)) kept[row] = true;
  return kept;
}

/// Values over time, the event, and where the camera looked.
class StepColumns {
 public:
  void add(double t_s, const IntrinsicsEstimate& step, const RotationFrame& frame, const TrueIntrinsics* truth);
  [[nodiscard]] DataTable table() const;

 private:
  Numbers t_, nis_, nis_dof_, weak_, event_point_;
  std::array<Numbers, 4> value_, sigma_, truth_, attitude_;
  std::array<Numbers, 3> rate_;
  std::vector<std::string> events_;
};

void StepColumns::add(double t_s, const IntrinsicsEstimate& step, const RotationFrame& frame,
                      const TrueIntrinsics* truth) {
  t_.push_back(t_s);
  for (std::size_t i = 0; i < 4; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    value_[i].push_back(step.has_value ? step.values()[at] : not_seen);
    sigma_[i].push_back(step.has_value ? step.sigma[at] : not_seen);
    if (truth != nullptr) truth_[i].push_back((*truth)[i]);
    attitude_[i].push_back(frame.cam_from_start.conjugate().coeffs()[at]);
  }
  for (std::size_t i = 0; i < 3; ++i) rate_[i].push_back(frame.rate_rad_per_s[static_cast<Eigen::Index>(i)]);
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

DataTable steps_table(const RotationLog& log, const ObserveReport& report) {
  MotionReader reader(log.source, 0.25);
  const std::vector<bool> is_kept = kept_rows(report);
  StepColumns columns;
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const RotationFrame frame = reader.next(log.rows[k]);
    if (is_kept[k]) columns.add(log.rows[k].t_s, report.steps[k], frame, log.truth.empty() ? nullptr : &log.truth[k]);
  }
  DataTable table = columns.table();
  record_steps_kept(table, log.rows.size(), "intrinsics.csv");
  return table;
}

/// Every so many of so many: a step that meets every point in turn.
std::size_t stride(std::size_t count, std::size_t num_points) {
  std::size_t every = (count + max_pixels - 1) / max_pixels;
  while (every > 1 && std::gcd(every, num_points) != 1) ++every;
  return std::max<std::size_t>(1, every);
}

/// Residuals of the reference adjustment, prediction minus pixel. `step` is a row of the log.
DataTable points_table(const RotationLog& log, const ObserveReport& report) {
  std::vector<int> step, point;
  Numbers u, v, du, dv;
  const Adjustment& reference = report.reference;
  const double s = report.scale.scale;
  std::vector<int> log_point(reference.bundle.points.size(), -1);
  for (std::size_t i = 0; i < reference.bundle_point_of.size(); ++i) {
    if (reference.bundle_point_of[i] >= 0) {
      log_point[static_cast<std::size_t>(reference.bundle_point_of[i])] = static_cast<int>(i);
    }
  }
  const std::size_t every = stride(reference.solution.residuals.size(), std::max<std::size_t>(1, log.num_points));
  for (std::size_t i = 0; i < reference.solution.residuals.size(); i += every) {
    const BundleObservation& seen = reference.bundle.observations[i];
    const double t_s = reference.bundle.frames[static_cast<std::size_t>(seen.frame)].t_s;
    const auto row = std::lower_bound(log.rows.begin(), log.rows.end(), t_s - 1e-9,
                                      [](const RotationRow& r, double t) { return r.t_s < t; });
    step.push_back(static_cast<int>(row - log.rows.begin()));
    point.push_back(log_point[static_cast<std::size_t>(seen.point)]);
    u.push_back(seen.px.x() * s + report.scale.centre.x());
    v.push_back(seen.px.y() * s + report.scale.centre.y());
    du.push_back(s * reference.solution.residuals[i].x());
    dv.push_back(s * reference.solution.residuals[i].y());
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

/// The bound is of the longest time without a zoom alone: σ, which holds the other rows as well, may be smaller.
void fill_reference(const RotationLog& log, const ObserveReport& report, JsonValue& bound) {
  const double from_s = log.rows.front().t_s, until_s = log.rows.back().t_s;
  const double first_s = std::max(from_s, report.reference_from_s),
               last_s = std::min(until_s, report.reference_until_s);
  constexpr double nearly_all = 0.9;
  if (!(last_s - first_s < nearly_all * (until_s - from_s))) return;
  bound["from_s"] = first_s;
  bound["until_s"] = last_s;
}

void fill_values(const ObserveReport& report, const Camera& camera, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["camera"] = camera_values(camera);
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

/// What tells the stated σ from the model's, and what was tested.
void fill_errors(const ObserveReport& report, ResultDocument& document) {
  document.assumed = report.assumed;
  const StatedCovariance& stated = report.stated;
  JsonValue& shared = document.estimate["shared_errors"];
  shared["design_effect"] = stated.blocks.design_effect;
  shared["correlation_s"] = stated.correlation_s;
  shared["block_s"] = stated.block_s;
  shared["track_effect"] = stated.track_effect;
  JsonValue causes = JsonValue::list();
  for (const CauseScore& cause : report.causes) {
    JsonValue each = JsonValue::object();
    each["name"] = cause.name;
    each["z"] = cause.z;
    JsonValue members = JsonValue::list();
    for (const CauseMember& member : cause.members) {
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

}  // namespace

DataTable observe_row(double t_s, const IntrinsicsEstimate& estimate, const RotationFrame& frame,
                      const TrueIntrinsics* truth) {
  StepColumns columns;
  columns.add(t_s, estimate, frame, truth);
  return columns.table();
}

void fill_observation(const RotationLog& log, const ObserveReport& report, const Camera& camera,
                      ResultDocument& document) {
  document.counts.given += log.rows.size();
  document.counts.used = report.rows_used;
  document.counts.dropped = log.rows.size() - report.rows_used;
  if (report.status == ObserveReport::Status::ok) {
    fill_values(report, camera, document);
    fill_errors(report, document);
    if (!log.rows.empty()) fill_reference(log, report, document.estimate["bound"]);
  }
  JsonValue events = JsonValue::list();
  for (const ObserveNote& note : report.events) {
    JsonValue event = JsonValue::object();
    event["t_s"] = note.t_s;
    event["kind"] = event_name(note.event);
    if (note.point >= 0) event["point"] = note.point + 1;
    events.push_back(std::move(event));
  }
  document.estimate["events"] = std::move(events);
  document.estimate["sigma_px"] = report.sigma_px;
  document.estimate["sigma_px_from"] = report.sigma_is_told ? "residuals" : "given";
  if (!log.truth.empty() && report.status == ObserveReport::Status::ok) {
    const std::vector<std::string> names{"fx", "fy", "cx", "cy"};
    for (std::size_t i = 0; i < 4; ++i) {
      document.estimate["error"][names[i]] = report.quantities[i].value - log.truth.back()[i];
    }
  }
  if (report.steps.size() == log.rows.size() && !log.rows.empty()) document.data.push_back(steps_table(log, report));
  if (!report.reference.has_value) return;
  document.data.push_back(points_table(log, report));
  record_steps_kept(document.data.back(), report.reference.solution.residuals.size(), "");
}

}  // namespace alidade
