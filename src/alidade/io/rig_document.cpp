#include "alidade/io/rig_document.h"

#include <cmath>
#include <limits>

namespace alidade {
namespace {

using Numbers = std::vector<double>;

Numbers list_of(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }
Numbers list_of(const Eigen::Quaterniond& q) { return {q.w(), q.x(), q.y(), q.z()}; }

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
  return value;
}

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

DataTable views_table(std::span<const HeadView> views, const RigReport& report) {
  std::vector<std::string> name, reason;
  std::vector<int> head, board;
  std::vector<bool> used;
  Numbers pan, tilt, rms, pan_off, tilt_off;
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
  }
  return {"views",
          {{"name", name},
           {"head", head},
           {"board", board},
           {"used", used},
           {"reason", reason},
           {"pan_rad", pan},
           {"tilt_rad", tilt},
           {"rms_px", rounded(rms, 5)},
           {"pan_correction_rad", rounded(pan_off, 8)},
           {"tilt_correction_rad", rounded(tilt_off, 8)}}};
}

}  // namespace

void fill_rig(std::span<const HeadView> views, const RigReport& report, ResultDocument& document) {
  document.counts.given += views.size();
  document.counts.used = static_cast<std::size_t>(report.views_used);
  document.counts.dropped = static_cast<std::size_t>(report.views_dropped);
  JsonValue& estimate = document.estimate;
  if (report.status == RigReport::Status::converged) {
    fill_heads(report.rig, document);
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
  if (report.views.size() == views.size()) document.data.push_back(views_table(views, report));
}

}  // namespace alidade
