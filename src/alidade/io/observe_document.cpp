#include "alidade/io/observe_document.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

using Numbers = std::vector<double>;

/// Values over time, the event, and where the camera looked.
DataTable steps_table(const RotationLog& log, const ObserveReport& report) {
  const std::vector<std::string> names{"fx", "fy", "cx", "cy"};
  Numbers t, nis, nis_dof, weak;
  std::vector<Numbers> value(4), sigma(4), truth(4), attitude(4), rate(3);
  std::vector<std::string> events;
  MotionReader reader(log.source, 0.25);
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const IntrinsicsEstimate& step = report.steps[k];
    const RotationFrame frame = reader.next(log.rows[k]);
    t.push_back(log.rows[k].t_s);
    for (std::size_t i = 0; i < 4; ++i) {
      const auto at = static_cast<Eigen::Index>(i);
      value[i].push_back(step.has_value ? step.values()[at] : not_seen);
      sigma[i].push_back(step.has_value ? step.sigma[at] : not_seen);
      if (!log.truth.empty()) truth[i].push_back(log.truth[k][i]);
      attitude[i].push_back(frame.cam_from_start.conjugate().coeffs()[at]);
    }
    for (std::size_t i = 0; i < 3; ++i) rate[i].push_back(frame.rate_rad_per_s[static_cast<Eigen::Index>(i)]);
    nis.push_back(step.nis_dof > 0 ? step.nis : not_seen);
    nis_dof.push_back(step.nis_dof);
    weak.push_back(step.has_value ? 1.0 / step.sigma.cwiseAbs2().maxCoeff() : not_seen);
    events.emplace_back(event_name(step.event));
  }
  DataTable table{"steps", {{"t_s", t}}};
  for (std::size_t i = 0; i < 4; ++i) table.columns.emplace_back(names[i] + "_px", rounded(value[i], 5));
  for (std::size_t i = 0; i < 4; ++i) table.columns.emplace_back("sigma_" + names[i] + "_px", rounded(sigma[i], 6));
  for (std::size_t i = 0; i < 4 && !log.truth.empty(); ++i) {
    table.columns.emplace_back("truth_" + names[i] + "_px", truth[i]);
  }
  table.columns.emplace_back("nis", rounded(nis, 4));
  table.columns.emplace_back("nis_dof", nis_dof);
  table.columns.emplace_back("event", events);
  table.columns.emplace_back("weak_eigenvalue", weak);
  const std::vector<std::string> axes{"x", "y", "z"}, quaternion{"qx", "qy", "qz", "qw"};
  for (std::size_t i = 0; i < 3; ++i) {
    table.columns.emplace_back("omega_" + axes[i] + "_rad_per_s", rounded(rate[i], 8));
  }
  for (std::size_t i = 0; i < 4; ++i) {
    table.columns.emplace_back("start_from_cam_" + quaternion[i], rounded(attitude[i], 8));
  }
  return table;
}

/// Residuals of the reference adjustment, pixel minus prediction. `step` is a row of `steps`.
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
  for (std::size_t i = 0; i < reference.solution.residuals.size(); ++i) {
    const BundleObservation& seen = reference.bundle.observations[i];
    const double t_s = reference.bundle.frames[static_cast<std::size_t>(seen.frame)].t_s;
    const auto row = std::lower_bound(log.rows.begin(), log.rows.end(), t_s - 1e-9,
                                      [](const RotationRow& r, double t) { return r.t_s < t; });
    step.push_back(static_cast<int>(row - log.rows.begin()));
    point.push_back(log_point[static_cast<std::size_t>(seen.point)]);
    u.push_back(seen.px.x() * s + report.scale.centre.x());
    v.push_back(seen.px.y() * s + report.scale.centre.y());
    du.push_back(-s * reference.solution.residuals[i].x());
    dv.push_back(-s * reference.solution.residuals[i].y());
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
  return name == "fx" || name == "fy" || name == "cx" || name == "cy" || name == "k1";
}

void fill_values(const ObserveReport& report, const Camera& camera, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["camera"]["model"] = model_name(camera.lens);
  estimate["camera"]["width"] = camera.width_px;
  estimate["camera"]["height"] = camera.height_px;
  const auto names = param_names(camera.lens);
  const Eigen::VectorXd values = params(camera.lens);
  for (std::size_t i = 0; i < names.size(); ++i) {
    estimate["camera"][names[i]] = values[static_cast<Eigen::Index>(i)];
  }
  for (const ObservedQuantity& quantity : report.quantities) {
    if (is_of_camera(quantity.name)) {
      document.stddev["camera"][quantity.name] = quantity.sigma;
    } else {
      estimate[quantity.name] = quantity.value;
      document.stddev[quantity.name] = quantity.sigma;
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

}  // namespace

void fill_observation(const RotationLog& log, const ObserveReport& report, const Camera& camera,
                      ResultDocument& document) {
  document.counts.given += log.rows.size();
  document.counts.used = report.rows_used;
  document.counts.dropped = log.rows.size() - report.rows_used;
  if (report.status == ObserveReport::Status::ok) fill_values(report, camera, document);
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
  if (report.reference.has_value) document.data.push_back(points_table(log, report));
}

}  // namespace alidade
