#include "alidade/results/turned_document.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "alidade/results/observe_document.h"

namespace alidade {
namespace {

void add_rows(const TurnedReport& report, const MatchedPhotos& photos, TurnedObservation& made) {
  const Eigen::Vector4d values = report.camera.head<4>();
  const Eigen::Vector4d sigma = report.cov.diagonal().head<4>().cwiseMax(0.0).cwiseSqrt();
  for (std::size_t i = 0; i < photos.names.size(); ++i) {
    const TurnedPhoto& photo = report.photos[i];
    RotationRow row;
    row.t_s = static_cast<double>(i);
    if (photo.is_used) row.base_from_cam = Eigen::Quaterniond(Eigen::Matrix3d(photo.cam_from_world.transpose()));
    made.log.rows.push_back(std::move(row));
    IntrinsicsEstimate step;
    step.has_value = report.status == TurnedReport::Status::ok && photo.is_used;
    step.fx = values[0];
    step.fy = values[1];
    step.cx = values[2];
    step.cy = values[3];
    step.k1 = report.camera[4];
    step.sigma = sigma;
    made.report.steps.push_back(step);
    made.report.rows_used += photo.is_used ? 1 : 0;
  }
}

void add_quantities(const TurnedReport& report, ObserveReport& observation) {
  static const char* const names[] = {"fx", "fy", "cx", "cy", "k1", "k2"};
  const Eigen::Index count = 4 + report.lens_terms;
  for (Eigen::Index i = 0; i < count; ++i) {
    const double model = std::sqrt(report.cov_model(i, i));
    observation.quantities.push_back({names[i], report.camera[i], std::sqrt(report.cov(i, i)), model, model});
  }
  observation.covariance = report.cov.topLeftCorner(count, count);
}

void add_observations(const TurnedReport& report, const MatchedPhotos& photos, ObserveReport& observation) {
  Adjustment& reference = observation.reference;
  reference.has_value = !report.bundle.observations.empty();
  reference.bundle.points.resize(report.bundle.rays.size());
  reference.bundle_point_of.resize(report.bundle.rays.size());
  std::iota(reference.bundle_point_of.begin(), reference.bundle_point_of.end(), 0);
  reference.bundle.frames.resize(photos.names.size());
  for (std::size_t i = 0; i < photos.names.size(); ++i) reference.bundle.frames[i].t_s = static_cast<double>(i);
  for (std::size_t i = 0; i < report.bundle.observations.size(); ++i) {
    const TurnedDetection& observation = report.bundle.observations[i];
    reference.bundle.observations.push_back(
        {report.bundle_photo[static_cast<std::size_t>(observation.photo)], observation.track, observation.px});
    reference.solution.residuals.push_back(report.residuals[i]);
    reference.solution.residual_px.push_back(report.residuals[i].norm());
  }
}

JsonValue photos_list(const TurnedReport& report, const MatchedPhotos& photos) {
  JsonValue list = JsonValue::list();
  for (std::size_t i = 0; i < photos.names.size(); ++i) {
    const TurnedPhoto& photo = report.photos[i];
    JsonValue row = JsonValue::object();
    row["file"] = photos.names[i];
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

DataTable photos_table(const TurnedReport& report, const MatchedPhotos& photos) {
  std::vector<std::string> reasons;
  std::vector<bool> used;
  std::vector<int> points;
  std::vector<double> rms, z2;
  for (const TurnedPhoto& photo : report.photos) {
    used.push_back(photo.is_used);
    reasons.push_back(photo.reason);
    points.push_back(photo.num_points);
    rms.push_back(photo.is_used ? photo.rms_px : not_seen);
    z2.push_back(photo.is_used && photo.z2 > 0.0 ? photo.z2 : not_seen);
  }
  return {"photos",
          {{"name", photos.names},
           {"used", used},
           {"reason", reasons},
           {"points", points},
           {"rms_px", rms},
           {"cluster_z2", z2}}};
}

/// Photos have no clock: what a log has by the second says nothing.
void drop_rates(std::vector<DataTable>& tables) {
  for (DataTable& table : tables) {
    if (table.name != "steps") continue;
    std::erase_if(table.columns, [](const auto& column) {
      return column.first.starts_with("omega_") || column.first == "weak_eigenvalue";
    });
  }
}

}  // namespace

TurnedObservation observation_of(const TurnedReport& report, const MatchedPhotos& photos) {
  TurnedObservation made;
  const bool is_ok = report.status == TurnedReport::Status::ok;
  made.report.status = is_ok ? ObserveReport::Status::ok : ObserveReport::Status::unobservable;
  made.report.width_px = photos.width_px;
  made.report.height_px = photos.height_px;
  made.report.scale = {Eigen::Vector2d(0.5 * (photos.width_px - 1), 0.5 * (photos.height_px - 1)),
                       0.5 * photos.width_px};
  made.report.sigma_px = report.sigma_px;
  made.report.assumed = report.assumed;
  made.report.stated.blocks.design_effect = report.design_effect;
  made.log.source = RotationSource::attitude;
  made.log.num_points = report.bundle.rays.size();
  add_rows(report, photos, made);
  if (is_ok) add_quantities(report, made.report);
  add_observations(report, photos, made.report);
  return made;
}

void fill_turned(const TurnedReport& report, const MatchedPhotos& photos, const TurnedObservation& observation,
                 const Camera& camera, ResultDocument& document) {
  fill_observation(observation.log, observation.report, camera, document);
  for (std::size_t i = 0; i < photos.names.size(); ++i) {
    if (!report.photos[i].is_used) document.counts.skipped.push_back({photos.names[i], 0, report.photos[i].reason});
  }
  drop_rates(document.data);
  document.data.insert(document.data.begin(), photos_table(report, photos));
  document.estimate["photos"] = photos_list(report, photos);
  JsonValue& matches = document.estimate["matches"];
  matches["given"] = report.num_matches;
  matches["agree_within_pairs"] = report.num_agreeing;
  matches["kept"] = report.num_kept;
  if (report.status != TurnedReport::Status::ok) return;
  JsonValue& parallax = document.estimate["parallax"];
  parallax["z"] = report.parallax.z;
  parallax["rms_px"] = report.parallax.rms_px;
  parallax["share_of_distance"] = report.parallax.relative;  // a radian of turn
}

}  // namespace alidade
