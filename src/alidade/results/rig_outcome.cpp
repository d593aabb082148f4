#include "alidade/results/rig_outcome.h"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <utility>

#include "alidade/files/number_list.h"
#include "alidade/geometry/degree.h"
#include "alidade/results/documents/heads_document.h"
#include "alidade/results/documents/number_columns.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

JsonValue covers_value(const RigReport& report) {
  JsonValue covers = JsonValue::list();
  for (const HeadCover& cover : report.covers) {
    JsonValue value;
    value["id"] = cover.id;
    value["views"] = cover.num_views;
    value["boards"] = cover.num_boards;
    value["shared_boards"] = cover.num_shared_boards;
    value["pan_rad"] = Numbers{cover.lowest_rad.x(), cover.highest_rad.x()};
    value["tilt_rad"] = Numbers{cover.lowest_rad.y(), cover.highest_rad.y()};
    covers.push_back(std::move(value));
  }
  return covers;
}

void add_pose(DataTable& table, const std::string& name, const std::vector<Rigid3>& poses) {
  NumberColumns columns{};
  columns.with_pose(name, 6);
  for (const Rigid3& pose : poses) columns.add_pose(&pose);
  columns.append_to(table);
}

const Head* head_of(const Rig& rig, int id) {
  const auto found = std::ranges::find_if(rig.heads, [id](const RigHead& one) { return one.head.id == id; });
  return found == rig.heads.end() ? nullptr : &found->head;
}

/// Which way each view's pan came from, of the same head: residuals of two levels by it are backlash. 0 at first.
std::vector<int> travel_signs(const std::vector<HeadView>& views) {
  std::map<int, double> last_rad;
  std::vector<int> signs;
  for (const HeadView& view : views) {
    const auto [last, is_first] = last_rad.try_emplace(view.head, view.pan_tilt_rad.x());
    const double moved_rad = view.pan_tilt_rad.x() - last->second;
    signs.push_back(is_first || std::abs(moved_rad) < 1e-3 ? 0 : moved_rad > 0.0 ? 1 : -1);
    last->second = view.pan_tilt_rad.x();
  }
  return signs;
}

/// The pan and the tilt axis of each head, at readings of zero, in the world: what the page draws.
DataTable axes_table(const Rig& rig) {
  std::vector<std::string> names;
  std::array<Numbers, 6> columns;
  for (const RigHead& one : rig.heads) {
    const Head& head = one.head;
    const Eigen::Vector2d angles = head.encoder.angles(Eigen::Vector2d::Zero());
    const Eigen::Matrix3d base_from_pan = Eigen::AngleAxisd(-angles.x(), Eigen::Vector3d::UnitY()).toRotationMatrix();
    const Eigen::Vector3d tilt_in_pan{std::cos(head.axes_skew_rad), std::sin(head.axes_skew_rad), 0.0};
    for (const bool is_pan : {true, false}) {
      Eigen::Vector3d point_in_base = Eigen::Vector3d::Zero(), direction_in_base = Eigen::Vector3d::UnitY();
      if (!is_pan) {
        point_in_base = base_from_pan * head.pan_to_tilt_m;
        direction_in_base = base_from_pan * tilt_in_pan;
      }
      const Eigen::Vector3d point_in_world = head.world_from_base * point_in_base;
      const Eigen::Vector3d direction_in_world = head.world_from_base.rotation * direction_in_base;
      names.push_back((is_pan ? "pan " : "tilt ") + std::to_string(head.id));
      for (int k = 0; k < 3; ++k) {
        columns[static_cast<std::size_t>(k)].push_back(point_in_world[k]);
        columns[static_cast<std::size_t>(3 + k)].push_back(direction_in_world[k]);
      }
    }
  }
  static constexpr std::array<const char*, 6> column_names{
      "point_in_world_x_m", "point_in_world_y_m", "point_in_world_z_m", "direction_x", "direction_y", "direction_z"};
  DataTable table{"axes", {{"name", names}}};
  for (std::size_t k = 0; k < columns.size(); ++k)
    table.columns.emplace_back(column_names[k], rounded(std::move(columns[k]), 6));
  return table;
}

/// Corners with their residuals, prediction − observation; `view` is a row of `views`.
DataTable corners_table(const RigCalibration& report) {
  const std::vector<HeadView>& views = report.measured;
  std::vector<int> view, corner;
  std::array<Numbers, 4> columns;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const auto& residuals = report.views[v].residual_px;
    if (residuals.size() != views[v].seen.corners.size()) continue;
    for (std::size_t i = 0; i < residuals.size(); ++i) {
      view.push_back(static_cast<int>(v));
      corner.push_back(views[v].seen.corners[i].index);
      columns[0].push_back(views[v].seen.corners[i].px.x());
      columns[1].push_back(views[v].seen.corners[i].px.y());
      columns[2].push_back(residuals[i].x());
      columns[3].push_back(residuals[i].y());
    }
  }
  return {"corners",
          {{"view", view},
           {"corner", corner},
           {"u_px", rounded(std::move(columns[0]), 2)},
           {"v_px", rounded(std::move(columns[1]), 2)},
           {"residual_u_px", rounded(std::move(columns[2]), 4)},
           {"residual_v_px", rounded(std::move(columns[3]), 4)}}};
}

std::vector<Rigid3> poses_of(const Rig& rig, const std::vector<HeadView>& views) {
  std::vector<Rigid3> world_from_cams;
  for (const HeadView& view : views) {
    const Head* const turned = head_of(rig, view.head);
    world_from_cams.push_back(turned ? world_from_cam(*turned, view.pan_tilt_rad) : Rigid3());
  }
  return world_from_cams;
}

DataTable views_table(const RigCalibration& report) {
  const std::vector<HeadView>& views = report.measured;
  std::vector<std::string> name, reason;
  std::vector<int> head, board;
  std::vector<bool> used;
  NumberColumns columns{
      {"pan_rad"},      {"tilt_rad"}, {"rms_px", 5}, {"pan_correction_rad", 8}, {"tilt_correction_rad", 8},
      {"cluster_z2", 4}};
  for (std::size_t v = 0; v < views.size(); ++v) {
    const HeadViewFit& fit = report.views[v];
    name.push_back(views[v].seen.photo);
    reason.push_back(fit.reason);
    head.push_back(views[v].head);
    board.push_back(views[v].board);
    used.push_back(fit.used);
    columns.add({views[v].pan_tilt_rad.x(), views[v].pan_tilt_rad.y(),
                 fit.residual_px.empty() ? missing_value : fit.rms_px, fit.reading_correction_rad.x(),
                 fit.reading_correction_rad.y(), fit.used ? fit.cluster_z2 : missing_value});
  }
  DataTable table{"views", {{"name", name}, {"head", head}, {"board", board}, {"used", used}, {"reason", reason}}};
  columns.append_to(table);
  table.columns.emplace_back("travel_sign", travel_signs(views));
  if (report.status != RigReport::Status::converged) return table;
  const std::vector<Rigid3> world_from_cams = poses_of(report.rig, views);
  add_pose(table, "world_from_cam", world_from_cams);
  add_pose(table, "base_from_cam", world_from_cams);  // the same by the name of earlier versions
  return table;
}

/// What was estimated by need, and backlash, which is no part of a head as a file has it.
void fill_freed(const RigReport& report, ResultDocument& document) {
  JsonValue freed = JsonValue::list(), backlash = JsonValue::list(), sigma = JsonValue::list();
  for (const RigFreed& one : report.freed) {
    JsonValue value;
    value["name"] = one.name;
    value["value"] = one.value;
    value["sigma"] = one.sigma;
    value["was"] = one.was;
    freed.push_back(std::move(value));
  }
  document.estimate["estimated"] = std::move(freed);
  for (std::size_t h = 0; h < report.backlash_rad.size(); ++h) {
    backlash.push_back(Numbers{report.backlash_rad[h].x(), report.backlash_rad[h].y()});
    sigma.push_back(Numbers{report.sigma_backlash_rad[h].x(), report.sigma_backlash_rad[h].y()});
  }
  document.estimate["backlash_rad"] = std::move(backlash);
  document.stddev["backlash_rad"] = std::move(sigma);
}

void fill_solved(const RigCalibration& result, ResultDocument& document) {
  JsonValue& estimate = document.estimate;
  fill_heads(result.rig, document);
  fill_freed(result, document);
  fill_heads_model(result.rig, result.cov_model, document);
  document.assumed = result.assumed;
  JsonValue causes = JsonValue::list();
  for (const RigCause& cause : result.causes) {
    JsonValue value;
    value["name"] = cause.name;
    value["size"] = cause.size;
    value["sigmas"] = cause.sigmas;
    causes.push_back(std::move(value));
  }
  estimate["causes"] = std::move(causes);
  estimate["design_effect"] = result.clusters.design_effect;
  estimate["chi2_per_dof"] = result.chi2_per_dof();
  estimate["rms_px"] = result.rms_px;
  estimate["sigma_relative_rad"] = result.sigma_relative_rad;
  estimate["sigma_relative_m"] = result.sigma_relative_m;
}

void fill_document(const RigCalibration& result, ResultDocument& document) {
  document.command = "rig";
  document.counts = result.counts;
  document.verdict = result.verdict;
  JsonValue& estimate = document.estimate;
  const bool is_solved = result.status == RigReport::Status::converged;
  if (is_solved) fill_solved(result, document);
  estimate["noise"]["sigma_px"] = result.sigma_px;
  estimate["noise"]["sigma_encoder_rad"] = result.sigma_encoder_rad;
  estimate["noise"]["px_from"] = result.sigma_px_is_estimated ? "residuals" : "given";
  estimate["noise"]["encoder_from"] = result.sigma_encoder_is_estimated ? "residuals" : "given or assumed";
  estimate["covers"] = covers_value(result);
  if (result.views.size() != result.measured.size()) return;
  document.data.push_back(views_table(result));
  if (!is_solved) return;
  document.data.push_back(axes_table(result.rig));
  document.data.push_back(corners_table(result));
}

void add_lines_of_head(const Rig& rig, std::size_t h, std::vector<std::string>& lines) {
  const Head& head = rig.heads[h].head;
  const HeadVector sigma = 3.0 * rig.cov.diagonal()
                                     .segment<num_head_params>(num_head_params * static_cast<Eigen::Index>(h))
                                     .cwiseMax(0.0)
                                     .cwiseSqrt();
  const Eigen::Vector3d &base = head.world_from_base.translation, &arm = head.tilt_to_cam_m;
  const Eigen::Vector3d arm_sigma = sigma.segment<3>(tilt_to_cam_param);
  const Eigen::Vector3d base_sigma = 3.0 * sigma_of_base(rig, rig.cov, h);  // of coordinates in the world, as they are
  lines.push_back(fmt::format("head {}: base at ({:.1f}, {:.1f}, {:.1f}) ± ({:.2g}, {:.2g}, {:.2g}) mm   (3σ)", head.id,
                              1e3 * base.x(), 1e3 * base.y(), 1e3 * base.z(), 1e3 * base_sigma.x(),
                              1e3 * base_sigma.y(), 1e3 * base_sigma.z()));
  lines.push_back(fmt::format("  tilt axis {:.2f} ± {:.2g} mm before the pan axis, {:.3f} ± {:.2g}° from square to it",
                              1e3 * head.pan_to_tilt_m.z(), 1e3 * sigma[pan_to_tilt_param + 2],
                              head.axes_skew_rad / degree, sigma[axes_skew_param] / degree));
  lines.push_back(fmt::format("  camera at ({:.2f}, {:.2f}, {:.2f}) ± ({:.2g}, {:.2g}, {:.2g}) mm from the tilt axis",
                              1e3 * arm.x(), 1e3 * arm.y(), 1e3 * arm.z(), 1e3 * arm_sigma.x(), 1e3 * arm_sigma.y(),
                              1e3 * arm_sigma.z()));
  for (const auto& [axis, scale] :
       {std::pair("pan", head.encoder.pan_scale), std::pair("tilt", head.encoder.tilt_scale)})
    if (scale < 0.0) lines.push_back(fmt::format("  its {} counts the other way: {}_scale {:.4g}", axis, axis, scale));
}

/// What the views indicate and no σ of the rig has: another lens, a drift, boards that were moved. Not scales of
/// encoders, which are estimated, and right.
std::string uncounted_cause(const Verdict& verdict) {
  for (const Check& check : verdict.checks) {
    const bool is_of_lens = check.name == "estimated" && check.text.find(lens_remedy) != std::string::npos;
    if (check.state == State::care && (check.name == "causes" || is_of_lens))
      return check.text.substr(0, check.text.find("; "));
  }
  return "";
}

std::vector<std::string> lines_of(const RigCalibration& result) {
  std::vector<std::string> no_boards, not_used, rejected;
  for (const SkippedInput& photo : result.no_board) no_boards.push_back(photo.file + ": " + photo.reason);
  for (std::size_t v = 0; v < result.views.size() && v < result.measured.size(); ++v) {
    const HeadViewFit& fit = result.views[v];
    if (!fit.used && !fit.reason.empty()) not_used.push_back(result.measured[v].seen.photo + ": " + fit.reason);
  }
  for (const SkippedInput& corners : result.wrong_corners) rejected.push_back(corners.file + ": " + corners.reason);
  std::vector<std::string> lines;
  add_each("no board", no_boards, lines);
  add_each("not used", not_used, lines);
  add_each("rejected", rejected, lines);
  const auto num_same = static_cast<std::size_t>(std::ranges::count_if(
      result.repeated, [](const SkippedInput& view) { return view.reason.starts_with("is the same image"); }));
  if (num_same < result.repeated.size())
    lines.push_back(fmt::format("averaged: {} of {} views show their board where the view before does",
                                result.repeated.size() - num_same, result.counts.given));
  if (num_same > 0)
    lines.push_back(
        fmt::format("not used: {} of {} views are the same image as another", num_same, result.counts.given));
  if (result.status != RigReport::Status::converged) return lines;
  for (std::size_t h = 0; h < result.rig.heads.size(); ++h) add_lines_of_head(result.rig, h, lines);
  for (const RigFreed& one : result.freed)
    lines.push_back(fmt::format("estimated too: {} {:.5g} ± {:.2g}", one.name, one.value, 3.0 * one.sigma));
  lines.push_back(fmt::format("{} of {} views; χ²/dof {:.3f}, rms {:.3f} px; σ of a reading {:.3g}° ({})",
                              result.views_used, result.views.size(), result.chi2_per_dof(), result.rms_px,
                              result.sigma_encoder_rad / degree,
                              result.sigma_encoder_is_estimated ? "estimated from the residuals"
                              : result.config.sigma_encoder_rad ? "as given"
                                                                : "assumed"));
  return lines;
}

}  // namespace

JobOutcome outcome_of(const RigCalibration& calibration) {
  JobOutcome outcome;
  fill_document(calibration, outcome.document);
  outcome.lines = lines_of(calibration);
  if (is_estimate(static_cast<int>(calibration.verdict.exit_code))) add_rig_files(calibration.rig, outcome.files);
  note_verdict({"rig.yaml"}, outcome, uncounted_cause(calibration.verdict));
  return outcome;
}

}  // namespace alidade
