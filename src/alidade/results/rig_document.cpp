#include "alidade/results/rig_document.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>

#include "alidade/files/number_list.h"

namespace alidade {
namespace {

using Numbers = std::vector<double>;

JsonValue head_value(const Head& head) {
  JsonValue value;
  value["id"] = head.id;
  value["world_from_base"]["translation_m"] = list_of(head.world_from_base.translation);
  value["world_from_base"]["quaternion_wxyz"] = list_of(head.world_from_base.rotation);
  value["pan_to_tilt_m"] = list_of(head.pan_to_tilt_m);
  value["tilt_to_cam_m"] = list_of(head.tilt_to_cam_m);
  value["cam_from_tilt"]["quaternion_wxyz"] = list_of(head.cam_from_tilt);
  value["axes_skew_rad"] = head.axes_skew_rad;
  value["encoder"]["pan_zero_rad"] = head.encoder.pan_zero_rad;
  value["encoder"]["tilt_zero_rad"] = head.encoder.tilt_zero_rad;
  value["encoder"]["pan_scale"] = head.encoder.pan_scale;
  value["encoder"]["tilt_scale"] = head.encoder.tilt_scale;
  value["encoder"]["pan_cos_rad"] = head.encoder.pan_cos_rad;
  value["encoder"]["pan_sin_rad"] = head.encoder.pan_sin_rad;
  value["encoder"]["tilt_cos_rad"] = head.encoder.tilt_cos_rad;
  value["encoder"]["tilt_sin_rad"] = head.encoder.tilt_sin_rad;
  value["encoder"]["sigma_rad"] = head.encoder.sigma_rad;
  return value;
}

/// σ by the names of a head; rotations as three small turns on the right.
JsonValue head_sigma(int id, const HeadVector& sigma) {
  JsonValue value;
  value["id"] = id;
  value["world_from_base"]["translation_m"] = list_of(Eigen::Vector3d(sigma.head<3>()));
  value["world_from_base"]["rotation_rad"] = list_of(Eigen::Vector3d(sigma.segment<3>(3)));
  value["pan_to_tilt_m"] = list_of(Eigen::Vector3d(sigma.segment<3>(6)));
  value["tilt_to_cam_m"] = list_of(Eigen::Vector3d(sigma.segment<3>(9)));
  value["cam_from_tilt"]["rotation_rad"] = list_of(Eigen::Vector3d(sigma.segment<3>(12)));
  value["axes_skew_rad"] = sigma[19];
  value["encoder"]["pan_scale"] = sigma[17];
  value["encoder"]["tilt_scale"] = sigma[18];
  value["encoder"]["pan_cos_rad"] = sigma[20];
  value["encoder"]["pan_sin_rad"] = sigma[21];
  value["encoder"]["tilt_cos_rad"] = sigma[22];
  value["encoder"]["tilt_sin_rad"] = sigma[23];
  return value;
}

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
  static constexpr std::array<const char*, 7> parts{"_x_m", "_y_m", "_z_m", "_qx", "_qy", "_qz", "_qw"};
  for (std::size_t k = 0; k < parts.size(); ++k) {
    const auto at = static_cast<Eigen::Index>(k < 3 ? k : k - 3);
    Numbers values;
    for (const Rigid3& pose : poses) values.push_back(k < 3 ? pose.translation[at] : pose.rotation.coeffs()[at]);
    table.columns.emplace_back(name + parts[k], rounded(std::move(values), 6));
  }
}

const Head* head_of(const Rig& rig, int id) {
  const auto found = std::ranges::find_if(rig.heads, [id](const RigHead& one) { return one.head.id == id; });
  return found == rig.heads.end() ? nullptr : &found->head;
}

/// Which way each view's pan came from, of the same head: residuals of two levels by it are backlash. 0 at first.
std::vector<int> travel_signs(std::span<const HeadView> views) {
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
DataTable corners_table(std::span<const HeadView> views, const RigReport& report) {
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

DataTable views_table(std::span<const HeadView> views, const RigReport& report) {
  std::vector<std::string> name, reason;
  std::vector<int> head, board;
  std::vector<bool> used;
  Numbers pan, tilt, rms, pan_off, tilt_off, z2;
  for (std::size_t v = 0; v < views.size(); ++v) {
    const HeadViewFit& fit = report.views[v];
    name.push_back(views[v].seen.photo);
    reason.push_back(fit.reason);
    head.push_back(views[v].head);
    board.push_back(views[v].board);
    used.push_back(fit.used);
    pan.push_back(views[v].pan_tilt_rad.x());
    tilt.push_back(views[v].pan_tilt_rad.y());
    rms.push_back(fit.residual_px.empty() ? std::numeric_limits<double>::quiet_NaN() : fit.rms_px);
    pan_off.push_back(fit.reading_correction_rad.x());
    tilt_off.push_back(fit.reading_correction_rad.y());
    z2.push_back(fit.used ? fit.cluster_z2 : std::numeric_limits<double>::quiet_NaN());
  }
  DataTable table{"views",
                  {{"name", name},
                   {"head", head},
                   {"board", board},
                   {"used", used},
                   {"reason", reason},
                   {"pan_rad", pan},
                   {"tilt_rad", tilt},
                   {"rms_px", rounded(rms, 5)},
                   {"pan_correction_rad", rounded(pan_off, 8)},
                   {"tilt_correction_rad", rounded(tilt_off, 8)},
                   {"cluster_z2", rounded(z2, 4)},
                   {"travel_sign", travel_signs(views)}}};
  if (report.status != RigReport::Status::converged) return table;
  std::vector<Rigid3> world_from_cams;
  for (const HeadView& view : views) {
    const Head* const turned = head_of(report.rig, view.head);
    world_from_cams.push_back(turned ? world_from_cam(*turned, view.pan_tilt_rad) : Rigid3());
  }
  add_pose(table, "base_from_cam", world_from_cams);
  return table;
}

}  // namespace

void fill_heads(const Rig& rig, ResultDocument& document) {
  JsonValue heads = JsonValue::list(), sigmas = JsonValue::list();
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const int id = rig.heads[h].head.id;
    heads.push_back(head_value(rig.heads[h].head));
    const HeadVector variance =
        rig.cov.diagonal().segment<num_head_params>(num_head_params * static_cast<Eigen::Index>(h));
    sigmas.push_back(head_sigma(id, variance.cwiseMax(0.0).cwiseSqrt()));
    for (const char* name : head_param_names)
      document.covariance_names.push_back("head" + std::to_string(id) + "." + name);
  }
  document.estimate["heads"] = std::move(heads);
  document.stddev["heads"] = std::move(sigmas);
  for (Eigen::Index i = 0; i < rig.cov.rows(); ++i)
    for (Eigen::Index j = i; j < rig.cov.cols(); ++j) document.covariance_upper.push_back(rig.cov(i, j));
}

void fill_heads_model(const Rig& rig, const Eigen::MatrixXd& cov_model, ResultDocument& document) {
  JsonValue sigmas = JsonValue::list();
  for (std::size_t h = 0; h < rig.heads.size(); ++h) {
    const HeadVector variance =
        cov_model.diagonal().segment<num_head_params>(num_head_params * static_cast<Eigen::Index>(h));
    sigmas.push_back(head_sigma(rig.heads[h].head.id, variance.cwiseMax(0.0).cwiseSqrt()));
  }
  document.stddev_model["heads"] = std::move(sigmas);
}

namespace {

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

}  // namespace

void fill_rig(std::span<const HeadView> views, const RigReport& report, ResultDocument& document) {
  document.counts.given += views.size();
  document.counts.used = static_cast<std::size_t>(report.views_used);
  document.counts.dropped = static_cast<std::size_t>(report.views_dropped);
  JsonValue& estimate = document.estimate;
  if (report.status == RigReport::Status::converged) {
    fill_heads(report.rig, document);
    fill_freed(report, document);
    fill_heads_model(report.rig, report.cov_model, document);
    document.assumed = report.assumed;
    JsonValue causes = JsonValue::list();
    for (const RigCause& cause : report.causes) {
      JsonValue value;
      value["name"] = cause.name;
      value["size"] = cause.size;
      value["sigmas"] = cause.sigmas;
      causes.push_back(std::move(value));
    }
    estimate["causes"] = std::move(causes);
    estimate["design_effect"] = report.clusters.design_effect;
    estimate["chi2_per_dof"] = report.chi2_per_dof();
    estimate["rms_px"] = report.rms_px;
    estimate["sigma_relative_rad"] = report.sigma_relative_rad;
    estimate["sigma_relative_m"] = report.sigma_relative_m;
  }
  estimate["noise"]["sigma_px"] = report.sigma_px;
  estimate["noise"]["sigma_encoder_rad"] = report.sigma_encoder_rad;
  estimate["noise"]["px_from"] = report.sigma_px_is_told ? "residuals" : "given";
  estimate["noise"]["encoder_from"] = report.sigma_encoder_is_told ? "residuals" : "given or assumed";
  estimate["covers"] = covers_value(report);
  if (report.views.size() != views.size()) return;
  document.data.push_back(views_table(views, report));
  if (report.status != RigReport::Status::converged) return;
  document.data.push_back(axes_table(report.rig));
  document.data.push_back(corners_table(views, report));
}

}  // namespace alidade
