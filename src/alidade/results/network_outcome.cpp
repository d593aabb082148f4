#include "alidade/results/network_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/report/thin.h"
#include "alidade/results/documents/heads_document.h"
#include "alidade/results/documents/number_columns.h"
#include "alidade/results/thin_tables.h"
#include "alidade/tables/events_file.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

JsonValue camera_value(const LocatedCamera& camera) {
  JsonValue value;
  value["id"] = camera.id;
  value["placed"] = camera.placed;
  value["reason"] = camera.reason;
  value["sights"] = camera.num_observations;
  value["used"] = camera.num_used;
  value["clock_offset_s"] = camera.clock.offset_s;
  value["clock_rate"] = camera.clock.rate;
  value["sigma_clock_s"] = camera.sigma_clock_s;
  value["sigma_clock_rate"] = camera.sigma_rate;
  value["sigma_px"] = camera.sigma_px;
  value["rms_px"] = camera.rms_px;
  return value;
}

/// The position of each located camera, with its covariance in the world, and half its view (tangents), to
/// draw it by.
DataTable cameras_table(const MovingTargetReport& report) {
  NumberColumns columns{{"id"}};
  columns.with_pose("world_from_cam").with_cov();
  columns.with({{"half_view_x"}, {"half_view_y"}, {"num_used"}, {"rms_px"}});
  for (std::size_t h = 0; h < report.cameras.size(); ++h) {
    if (!report.cameras[h].placed) continue;
    const RigHead& head = report.rig.heads[h];
    // The covariance is of steps on the right: along the base's own axes.
    const Rigid3& base = head.head.world_from_base;
    const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
    const Eigen::Matrix3d R = base.rotation.toRotationMatrix();
    // It does not rotate: its axes stand where the encoder is at zero.
    const Rigid3 cam = world_from_cam(head.head, head.head.encoder.readings(Eigen::Vector2d::Zero()));
    const Eigen::VectorXd lens = params(head.camera.lens);  // the first two of any: fx, fy
    columns.add({static_cast<double>(report.cameras[h].id)});
    columns.add_pose(&cam);
    columns.add_cov(R * report.rig.cov.block<3, 3>(at, at) * R.transpose());
    columns.add({0.5 * head.camera.width_px / lens[0], 0.5 * head.camera.height_px / lens[1],
                 static_cast<double>(report.cameras[h].num_used), report.cameras[h].rms_px});
  }
  DataTable table{"cameras", {}};
  columns.append_to(table);
  return table;
}

DataTable path_table(const MovingTargetReport& report) {
  std::array<Numbers, 4> columns;
  const std::vector<bool> none(report.path.size(), false);
  for (const std::size_t row : report::thinned_rows(report.path.size(), {}, none, report::max_step_rows)) {
    columns[0].push_back(report.path_t_s[row]);
    for (std::size_t k = 0; k < 3; ++k) columns[k + 1].push_back(report.path[row][static_cast<Eigen::Index>(k)]);
  }
  DataTable table{"path",
                  {{"t_s", rounded(columns[0], 6)},
                   {"target_in_world_x_m", rounded(columns[1], 6)},
                   {"target_in_world_y_m", rounded(columns[2], 6)},
                   {"target_in_world_z_m", rounded(columns[3], 6)}}};
  record_steps_kept(table, report.path.size(), "", "path.csv");
  return table;
}

void fill_placed(const NetworkCalibration& result, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  // Of a camera that was not located there is nothing to say: it is missing, as in rig.yaml.
  const Rig located = located_rig(result);
  fill_heads(located, document);
  estimate["chi2_per_dof"] = result.chi2_per_dof;
  fill_heads_model(located, located_part(result, result.cov_model), document);
  document.assumed = result.assumed;
  estimate["design_effect"] = result.clusters.design_effect;
  estimate["block_s"] = result.block_s;
  estimate["sigma_relative_rad"] = result.sigma_relative_rad;
  estimate["sigma_relative_m"] = result.sigma_relative_m;
  estimate["sigma_scale"] = result.sigma_scale;
  if (result.truth_covered > 0.0) {
    estimate["true_path"]["median_m"] = result.truth_median_m;
    estimate["true_path"]["rms_m"] = result.truth_rms_m;
    estimate["true_path"]["covered"] = result.truth_covered;
    estimate["true_path"]["clock_offset_s"] = result.truth_clock.offset_s;
    estimate["true_path"]["clock_rate"] = result.truth_clock.rate;
  }
  document.data.push_back(path_table(result));
  document.data.push_back(cameras_table(result));
}

/// Text of path.csv: `t_s,x_m,y_m,z_m`.
std::string path_csv(const MovingTargetReport& report) {
  std::string text = "t_s,x_m,y_m,z_m\n";
  for (std::size_t i = 0; i < report.path.size(); ++i) {
    const Eigen::Vector3d& point = report.path[i];
    text += fmt::format("{:.6f},{:.6f},{:.6f},{:.6f}\n", report.path_t_s[i], point.x(), point.y(), point.z());
  }
  return text;
}

void add_lines_of_camera(const NetworkCalibration& result, std::size_t h, std::vector<std::string>& lines) {
  const LocatedCamera& camera = result.cameras[h];
  const Eigen::Index at = num_head_params * static_cast<Eigen::Index>(h);
  const Eigen::Vector3d& position = result.rig.heads[h].head.world_from_base.translation;
  const HeadVector sigma = 3.0 * result.rig.cov.diagonal().segment<num_head_params>(at).cwiseMax(0.0).cwiseSqrt();
  lines.push_back(
      fmt::format("head {}: at ({:.2f}, {:.2f}, {:.2f}) m ± {:.2g} m, ± {:.2g}°   (3σ), {} of {} observations solved "
                  "for, σ {:.2g} px",
                  camera.id, position.x(), position.y(), position.z(), sigma.head<3>().norm(),
                  sigma.segment<3>(base_rotation_param).norm() / degree, camera.num_used, camera.num_observations,
                  camera.sigma_px));
  lines.push_back(fmt::format("  its clock: time of the rig = {:.4f} s + {:.6f} · its own, ± {:.2g} s (3σ)",
                              camera.clock.offset_s, camera.clock.rate, 3.0 * camera.sigma_clock_s));
}

std::vector<std::string> lines_of(const NetworkCalibration& result) {
  std::vector<std::string> lines;
  for (std::size_t h = 0; h < result.cameras.size(); ++h) {
    const LocatedCamera& camera = result.cameras[h];
    if (!camera.placed && !camera.reason.empty())
      lines.push_back(fmt::format("head {}: not located: {}", camera.id, camera.reason));
    if (camera.placed && result.status == MovingTargetReport::Status::placed) add_lines_of_camera(result, h, lines);
  }
  if (result.truth_covered > 0.0)
    lines.push_back(fmt::format(
        "against the true path, after a similarity: median {:.3f} m, RMS {:.3f} m, over {:.0f} % of the path",
        result.truth_median_m, result.truth_rms_m, 100.0 * result.truth_covered));
  return lines;
}

}  // namespace

JobOutcome outcome_of(const NetworkCalibration& calibration) {
  JobOutcome outcome;
  ResultDocument& document = outcome.document;
  document.command = "rig";
  document.counts = calibration.counts;
  document.verdict = calibration.verdict;
  JsonValue cameras = JsonValue::list();
  for (const LocatedCamera& camera : calibration.cameras) cameras.push_back(camera_value(camera));
  document.estimate["cameras"] = std::move(cameras);
  if (calibration.status == MovingTargetReport::Status::placed) fill_placed(calibration, document);
  outcome.lines = lines_of(calibration);
  if (!is_estimate(static_cast<int>(calibration.verdict.exit_code))) return outcome;
  add_rig_files(located_rig(calibration), outcome.files);
  note_verdict({"rig.yaml"}, outcome);
  outcome.files.push_back({"events.csv", events_csv(observations_on_one_clock(calibration), calibration.rig.heads)});
  outcome.files.push_back({"path.csv", path_csv(calibration)});
  return outcome;
}

}  // namespace alidade
