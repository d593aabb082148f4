#include "alidade/io/moving_document.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "alidade/io/rig_document.h"
#include "alidade/io/thin_tables.h"
#include "alidade/report/thin.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;
constexpr std::size_t most_rows = 4000;  // the page holds them; path.csv has all

JsonValue camera_value(const PlacedCamera& camera) {
  JsonValue value;
  value["id"] = camera.id;
  value["placed"] = camera.placed;
  value["reason"] = camera.reason;
  value["sights"] = camera.num_sights;
  value["used"] = camera.num_used;
  value["clock_offset_s"] = camera.clock.offset_s;
  value["clock_rate"] = camera.clock.rate;
  value["sigma_clock_s"] = camera.sigma_clock_s;
  value["sigma_clock_rate"] = camera.sigma_rate;
  value["sigma_px"] = camera.sigma_px;
  value["rms_px"] = camera.rms_px;
  return value;
}

DataTable path_table(const MovingTargetReport& report) {
  std::array<Numbers, 4> columns;
  const std::vector<bool> none(report.path.size(), false);
  for (const std::size_t row : report::thinned_rows(report.path.size(), {}, none, most_rows)) {
    columns[0].push_back(report.path_t_s[row]);
    for (std::size_t k = 0; k < 3; ++k) columns[k + 1].push_back(report.path[row][static_cast<Eigen::Index>(k)]);
  }
  DataTable table{"path",
                  {{"t_s", rounded(columns[0], 6)},
                   {"target_in_base_x_m", rounded(columns[1], 6)},
                   {"target_in_base_y_m", rounded(columns[2], 6)},
                   {"target_in_base_z_m", rounded(columns[3], 6)}}};
  record_steps_kept(table, report.path.size(), "path.csv");
  return table;
}

}  // namespace

void fill_moving_target(std::span<const TargetSight> sights, const MovingTargetReport& report,
                        ResultDocument& document) {
  document.counts.given += sights.size();
  document.counts.used = static_cast<std::size_t>(std::ranges::count(report.used, true));
  document.counts.dropped = sights.size() - document.counts.used;
  JsonValue& estimate = document.estimate;
  JsonValue cameras = JsonValue::list();
  for (const PlacedCamera& camera : report.cameras) cameras.push_back(camera_value(camera));
  estimate["cameras"] = std::move(cameras);
  if (report.status != MovingTargetReport::Status::placed) return;
  fill_heads(report.rig, document);
  estimate["chi2_per_dof"] = report.chi2_per_dof;
  fill_heads_model(report.rig, report.cov_model, document);
  document.assumed = report.assumed;
  estimate["design_effect"] = report.clusters.design_effect;
  estimate["block_s"] = report.block_s;
  estimate["sigma_relative_rad"] = report.sigma_relative_rad;
  estimate["sigma_relative_m"] = report.sigma_relative_m;
  estimate["sigma_scale"] = report.sigma_scale;
  if (report.truth_covered > 0.0) {
    estimate["true_path"]["median_m"] = report.truth_median_m;
    estimate["true_path"]["rms_m"] = report.truth_rms_m;
    estimate["true_path"]["covered"] = report.truth_covered;
    estimate["true_path"]["clock_offset_s"] = report.truth_clock.offset_s;
    estimate["true_path"]["clock_rate"] = report.truth_clock.rate;
  }
  document.data.push_back(path_table(report));
}

std::vector<TargetSight> sights_on_one_clock(std::span<const TargetSight> sights, const MovingTargetReport& report) {
  std::vector<TargetSight> on_rig;
  for (const TargetSight& sight : sights) {
    const PlacedCamera& camera = report.cameras[sight.head];
    if (!camera.placed) continue;
    on_rig.push_back(sight);
    on_rig.back().t_capture_s = on_rig.back().t_arrival_s = camera.clock.in_rig(sight.t_capture_s);
    if (!(sight.sigma_px > 0.0)) on_rig.back().sigma_px = camera.sigma_px;
  }
  std::ranges::stable_sort(on_rig, {}, &TargetSight::t_capture_s);
  return on_rig;
}

std::string moving_path_csv(const MovingTargetReport& report) {
  std::string text = "t_s,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < report.path.size(); ++i) {
    const Eigen::Vector3d& point = report.path[i];
    text += fmt::format("{:.6f},{:.6f},{:.6f},{:.6f}\n", report.path_t_s[i], point.x(), point.y(), point.z());
  }
  return text;
}

}  // namespace alidade
