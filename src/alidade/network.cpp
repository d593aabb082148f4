#include "alidade/network.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/camera/camera_fault.h"
#include "alidade/network/moving_target.h"

namespace alidade {
namespace {

std::string fault_of(const TargetObservation& observation, std::size_t num_heads) {
  if (observation.head >= num_heads) return "it is of a head that is not given";
  const bool is_finite = std::isfinite(observation.t_capture_s) && observation.pan_tilt_rad.allFinite() &&
                         observation.px.allFinite() && std::isfinite(observation.sigma_px);
  return is_finite ? "" : "its numbers are not finite";
}

bool has_head(const std::vector<RigHead>& heads, int id) {
  return std::ranges::any_of(heads, [id](const RigHead& head) { return head.head.id == id; });
}

void require_sense(const std::vector<TargetObservation>& observations, const std::vector<RigHead>& heads,
                   const MovingTargetConfig& config, const TrueTrack& truth) {
  std::vector<std::string> found = faults(config);
  if (config.distance && !truth.t_s.empty()) found.emplace_back("--distance: --truth gives the scale already");
  if (config.distance) {
    for (const int id : {config.distance->first, config.distance->second})
      if (!has_head(heads, id)) found.push_back("--distance: " + std::to_string(id) + " is not a head of the table");
  }
  for (const RigHead& head : heads) {
    const std::string of_camera = fault(head.camera);
    if (!of_camera.empty()) found.push_back("head " + std::to_string(head.head.id) + ": " + of_camera);
  }
  for (std::size_t i = 0; i < observations.size(); ++i) {
    const std::string what = fault_of(observations[i], heads.size());
    if (what.empty()) continue;
    found.push_back("observation " + std::to_string(i) + ": " + what);
    break;
  }
  const bool is_path = truth.t_s.size() == truth.position.size() && std::ranges::is_sorted(truth.t_s);
  if (!is_path) found.emplace_back("the true path must have a position for each time, in order of time");
  require_none(found);
}

}  // namespace

NetworkCalibration network(std::vector<TargetObservation> observations, const std::vector<RigHead>& heads,
                           const MovingTargetConfig& config, const TrueTrack& truth, const Progress& progress) {
  require_sense(observations, heads, config, truth);
  NetworkCalibration result;
  result.config = config;
  static_cast<MovingTargetReport&>(result) = place_cameras(observations, heads, config, truth, progress);
  result.verdict = moving_target_verdict(result, config);
  result.counts.given = observations.size();
  result.counts.used = static_cast<std::size_t>(std::ranges::count(result.used, true));
  result.counts.dropped = result.counts.given - result.counts.used;
  result.observations = std::move(observations);
  if (result.status != MovingTargetReport::Status::placed) return result;
  const Rig located = located_rig(result);
  result.covariance = located.cov;
  result.parameter_names = parameter_names(located);
  return result;
}

Eigen::MatrixXd located_part(const MovingTargetReport& report, const Eigen::MatrixXd& of_all) {
  std::vector<Eigen::Index> from;
  for (std::size_t h = 0; h < report.cameras.size(); ++h)
    for (Eigen::Index k = 0; report.cameras[h].placed && k < num_head_params; ++k)
      from.push_back(num_head_params * static_cast<Eigen::Index>(h) + k);
  return of_all(from, from);
}

Rig located_rig(const MovingTargetReport& report) {
  Rig rig;
  for (std::size_t h = 0; h < report.cameras.size(); ++h)
    if (report.cameras[h].placed) rig.heads.push_back(report.rig.heads[h]);
  rig.cov = located_part(report, report.rig.cov);
  return rig;
}

std::vector<TargetObservation> observations_on_one_clock(const NetworkCalibration& calibration) {
  std::vector<TargetObservation> on_rig;
  for (const TargetObservation& observation : calibration.observations) {
    const LocatedCamera& camera = calibration.cameras[observation.head];
    if (!camera.placed) continue;
    on_rig.push_back(observation);
    on_rig.back().t_capture_s = on_rig.back().t_arrival_s = camera.clock.in_rig(observation.t_capture_s);
    if (!(observation.sigma_px > 0.0)) on_rig.back().sigma_px = camera.sigma_px;
  }
  std::ranges::stable_sort(on_rig, {}, &TargetObservation::t_capture_s);
  return on_rig;
}

}  // namespace alidade
