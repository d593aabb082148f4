#include "alidade/results/localize_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/formats/camera_file.h"
#include "alidade/geometry/degree.h"
#include "alidade/localize/path/path_error.h"
#include "alidade/report/thin.h"
#include "alidade/results/documents/number_columns.h"
#include "alidade/results/thin_tables.h"
#include "alidade/tables/localize_file.h"
#include "alidade/tables/map_file.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;
NumberColumns path_columns(bool has_truth) {
  NumberColumns columns{{"t_s", 6}};
  columns.with_pose("world_from_cam", 7);
  for (const char* part : {"x_m", "y_m", "z_m", "rx_rad", "ry_rad", "rz_rad"})
    columns.with({{std::string("sigma_world_from_cam_") + part, 8}});
  if (has_truth) columns.with_pose("truth", 7);
  return columns.with({{"num_seen", 0}, {"num_tracked", 0}, {"num_gated", 0}, {"nis", 4}, {"seconds", 7}});
}

DataTable path_table(std::span<const PathStep> path, std::span<const TimedPose> truth) {
  std::vector<bool> must_keep;
  std::vector<double> nis;
  for (const PathStep& step : path) {
    must_keep.push_back(step.event == FrameEvent::started || step.event == FrameEvent::restarted);
    nis.push_back(step.nis_per_dof);
  }
  NumberColumns columns = path_columns(!truth.empty());
  std::vector<std::string> events;
  for (const std::size_t row : report::thinned_rows(path.size(), {nis}, must_keep, report::max_step_rows)) {
    const PathStep& step = path[row];
    columns.add({step.t_s});
    columns.add_pose(step.has_pose() ? &step.world_from_cam : nullptr);
    for (Eigen::Index i = 0; i < 6; ++i) columns.add({step.has_pose() ? std::sqrt(step.cov(i, i)) : missing_value});
    if (!truth.empty()) {
      const TimedPose* const there = nearest_pose(truth, step.t_s);
      columns.add_pose(there != nullptr ? &there->world_from_cam : nullptr);
    }
    columns.add({static_cast<double>(step.num_seen), static_cast<double>(step.num_tracked),
                 static_cast<double>(step.num_gated), step.nis_per_dof, step.seconds});
    events.emplace_back(event_name(step.event));
  }
  DataTable table{"path", {}};
  columns.append_to(table);
  table.columns.emplace_back("event", events);
  record_steps_kept(table, path.size(), "nis", "poses.csv");
  return table;
}

DataTable features_table(const Localization& result) {
  NumberColumns columns{{"point_in_world_x_m", 7}, {"point_in_world_y_m", 7}, {"point_in_world_z_m", 7}};
  columns.with_cov();
  std::vector<std::int64_t> ids, seen;
  std::vector<bool> known;
  for (const MapPoint& point : result.map) {
    ids.push_back(point.id);
    seen.push_back(static_cast<std::int64_t>(point.num_seen));
    known.push_back(point.is_known);
    columns.add(point.point_in_world);
    columns.add_cov(point.cov);
  }
  DataTable table{"features", {{"id", ids}}};
  columns.append_to(table);
  table.columns.emplace_back("num_seen", seen);
  table.columns.emplace_back("known", known);
  return table;
}

void fill_path_estimate(const Localization& result, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  estimate["frames"] = result.path.size();
  estimate["lost"] = result.num_lost;
  estimate["ate_m"] = result.error.ate_m;
  estimate["rpe_m"] = result.error.rpe_m;
  estimate["rpe_rad"] = result.error.rpe_rad;
  estimate["unaligned_m"] = result.scale_known ? result.error.unaligned_m : missing_value;
  estimate["stated_m"] = result.error.stated_m;
  estimate["nees_per_dof"] = result.error.nees_per_dof;
  estimate["nees_aligned_per_dof"] = result.error.nees_aligned_per_dof;
  estimate["alignment"] = result.truth.empty() ? JsonValue() : JsonValue(result.scale_known ? "SE(3)" : "Sim(3)");
  estimate["nis_per_dof"] = result.nis_per_dof;
  estimate["sigma_px"] = result.sigma_px;
  estimate["sigma_px_from"] = source_name(result.sigma_px_from);
  estimate["scale_known"] = result.scale_known;
  estimate["restarts"] = result.num_restarts;
  estimate["loops"] = result.num_loops;
  estimate["loops_rejected"] = result.num_loops_rejected;
  estimate["sights"] = result.num_observations;
  estimate["sights_gated"] = result.num_gated;
  JsonValue tested = JsonValue::list();
  for (const GivenNumber& given : result.given) {
    if (given.z == 0.0) continue;
    JsonValue each = JsonValue::object();
    each["name"] = given.name;
    each["asked"] = given.asked;
    each["sigma"] = std::abs(given.asked / given.z);
    each["z"] = given.z;
    tested.push_back(each);
  }
  estimate["tested"] = tested;
  const std::vector<std::string> all = param_names(result.camera.lens);
  const Eigen::VectorXd values = params(result.camera.lens);
  for (std::size_t k = 0; k < result.lens_params.size(); ++k) {
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i] == result.lens_params[k]) estimate["camera"][all[i]] = values[static_cast<Eigen::Index>(i)];
    if (static_cast<Eigen::Index>(k) < result.sigma_lens.size())
      document.stddev["camera"][result.lens_params[k]] = result.sigma_lens[static_cast<Eigen::Index>(k)];
  }
  document.data.push_back(path_table(result.path, result.truth));
  document.data.push_back(features_table(result));
}

JsonValue list_of(const Eigen::Vector3d& v) {
  JsonValue list = JsonValue::list();
  for (const double each : {v.x(), v.y(), v.z()}) list.push_back(each);
  return list;
}

void fill_imu(const ImuEstimate& imu, ResultDocument& document) {
  JsonValue &estimate = document.estimate["imu"], &stddev = document.stddev["imu"];
  estimate["used"] = imu.fault == ImuFault::none;
  if (imu.fault != ImuFault::none) return;
  const auto add = [&](const char* name, const Eigen::Vector3d& value, const Eigen::Vector3d& sigma) {
    estimate[name] = list_of(value);
    stddev[name] = list_of(sigma);
  };
  add("gravity_in_world_m_s2", imu.gravity_in_world, imu.sigma_gravity);
  add("gyro_bias_rad_s", imu.rate_bias, imu.sigma_rate_bias);
  add("accelerometer_bias_m_s2", imu.force_bias, imu.sigma_force_bias);
  add("position_in_cam_m", imu.cam_from_imu.translation, imu.sigma_position_m);
  const Eigen::Quaterniond& q = imu.cam_from_imu.rotation;
  estimate["cam_from_imu_quaternion_wxyz"] = JsonValue::list();
  for (const double each : {q.w(), q.x(), q.y(), q.z()}) estimate["cam_from_imu_quaternion_wxyz"].push_back(each);
  stddev["cam_from_imu_rad"] = list_of(imu.sigma_rotation_rad);
  estimate["clock_s"] = imu.late_s;
  stddev["clock_s"] = imu.sigma_late_s;
  estimate["scale"] = imu.scale;
  stddev["scale"] = imu.scale * imu.sigma_scale;
  estimate["gyro_noise_factor"] = imu.rate_noise_factor;
  estimate["accelerometer_noise_factor"] = imu.force_noise_factor;
  estimate["steps"] = imu.num_steps;
  estimate["steps_rejected"] = imu.num_rejected;
  estimate["steps_missing"] = imu.num_missing;
}

void path_lines(const Localization& result, std::vector<std::string>& lines) {
  if (result.path.empty() || !result.path.back().has_pose()) return;
  const PathStep& last = result.path.back();
  const Eigen::Vector<double, 6> sigma = last.cov.diagonal().cwiseSqrt();
  lines.push_back(fmt::format("{} frames, {} lost; {} points in the map; at the end within ± {:.2g} m, ± {:.2g}° (3σ)",
                              result.path.size(), result.num_lost, result.map.size(), 3.0 * sigma.head<3>().maxCoeff(),
                              3.0 * sigma.tail<3>().maxCoeff() / degree));
  if (std::isfinite(result.nis_per_dof))
    lines.push_back(fmt::format("NIS per degree of freedom {:.2f}", result.nis_per_dof));
  if (result.sigma_px_from == SigmaPxFrom::residuals)
    lines.push_back(fmt::format("σ of a pixel {:.2g} px (estimated from the {})", result.sigma_px,
                                result.is_of_images ? "residuals" : "tracks"));
  if (result.smoothed_every > 1)
    lines.push_back(fmt::format("one in {} frames is solved for with all others, those between follow from it",
                                result.smoothed_every));
  if (result.num_loops > 0)
    lines.push_back(fmt::format("{} loops closed: what was seen long before is seen again", result.num_loops));
  if (result.num_loops_rejected > 0)
    lines.push_back(fmt::format("{} loops rejected: places that look alike, or have the same numbers, and are not one",
                                result.num_loops_rejected));
  if (result.imu && result.imu->fault == ImuFault::none)
    lines.push_back(fmt::format("IMU: {} steps, {} rejected; scale ± {:.2g} % (3σ), clock {:.4f} ± {:.4f} s",
                                result.imu->num_steps, result.imu->num_rejected, 300.0 * result.imu->sigma_scale,
                                result.imu->late_s, 3.0 * result.imu->sigma_late_s));
  if (std::isfinite(result.error.ate_m))
    lines.push_back(fmt::format("against the truth: ATE {:.4g} m ({} alignment), RPE {:.4g} m a frame",
                                result.error.ate_m, result.scale_known ? "SE(3)" : "Sim(3)", result.error.rpe_m));
  const std::vector<std::string> names = param_names(result.camera.lens);
  const Eigen::VectorXd values = params(result.camera.lens);
  for (std::size_t k = 0; k < result.lens_params.size(); ++k) {
    const auto at = std::ranges::find(names, result.lens_params[k]) - names.begin();
    if (static_cast<Eigen::Index>(k) >= result.sigma_lens.size()) continue;  // never started
    lines.push_back(fmt::format("{} {:.6g} ± {:.2g}", result.lens_params[k], values[at],
                                3.0 * result.sigma_lens[static_cast<Eigen::Index>(k)]));
  }
}

void add_path_files(const Localization& result, std::vector<NamedBytes>& files) {
  if (!is_estimate(static_cast<int>(result.verdict.exit_code))) return;
  std::vector<TimedPose> path;
  for (const PathStep& step : result.path)
    if (step.has_pose()) path.push_back({step.t_s, step.world_from_cam});
  files.push_back({"trajectory.tum", tum_text(path)});
  files.push_back({"poses.csv", poses_csv(result.path)});
  files.push_back({"map.csv", map_csv(result.map)});
  files.push_back({"map.ply", map_ply(result.map)});
  if (!result.saved_map.points.empty()) files.push_back({"map.yaml", map_text(result.saved_map)});
  if (!result.lens_params.empty()) files.push_back({"camera.yaml", camera_text(result.camera, CameraFormat::alidade)});
}

}  // namespace

DataTable localize_row(const PathStep& step, std::span<const TimedPose> truth) { return path_table({&step, 1}, truth); }

JobOutcome outcome_of(const Localization& localization) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "localize";
  document.counts = localization.counts;
  document.assumed = localization.assumed;
  document.verdict = localization.verdict;
  fill_path_estimate(localization, document);
  if (localization.imu) fill_imu(*localization.imu, document);
  path_lines(localization, outcome.lines);
  add_path_files(localization, outcome.files);
  note_verdict({"camera.yaml"}, outcome);
  return outcome;
}

}  // namespace alidade
