#include "alidade/localize/checks/summary.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <set>
#include <vector>

#include "alidade/geometry/so3.h"
#include "alidade/localize/checks/judge.h"
#include "alidade/localize/path/path_error.h"

namespace alidade {

void sum_up(const FilterBank* bank, const std::function<std::size_t(long id)>& num_used, Localization& result) {
  double nis = 0.0, dof = 0.0;
  for (const PathStep& step : result.path) {
    result.num_observations += step.num_seen;
    result.num_used += step.num_tracked;
    result.num_gated += step.num_gated;
    result.num_known += step.num_known;
    result.num_known_gated += step.num_known_gated;
    result.max_seen = std::max(result.max_seen, step.num_seen);
    result.num_lost += step.event == FrameEvent::waiting || step.event == FrameEvent::predicted ? 1 : 0;
    if (step.num_tracked > 0 && std::isfinite(step.nis_per_dof)) {
      nis += step.nis_per_dof * static_cast<double>(step.num_tracked);
      dof += static_cast<double>(step.num_tracked);
    }
  }
  if (dof > 0.0) result.nis_per_dof = nis / dof;
  if (!result.is_of_images && !result.is_scale_read) result.scale_known = result.scale_known && result.num_known > 0;
  if (!bank) return;
  const LocalizationFilter& filter = bank->best();
  result.camera = filter.camera();
  result.sigma_lens = filter.lens_sigmas();
  for (const Feature& feature : filter.features()) {
    if (!result.is_of_images && feature.is_known && num_used(feature.id) == 0) continue;  // given, never seen
    const auto place = filter.place(feature.id);
    result.map.push_back({feature.id, place->point_in_world, place->cov, feature.is_known, num_used(feature.id)});
  }
}

std::optional<double> sigma_of_times(const LocalizeConfig& config, const Localization& result) {
  if (config.sigma_times_s) return config.sigma_times_s;
  if (!result.imu || result.imu->fault != ImuFault::none || clocks_differ(result)) return std::nullopt;
  return std::hypot(result.imu->sigma_late_s, result.imu->late_s);
}

void widen_by_times(double sigma_s, Localization& result) {
  const std::vector<PathStep>& path = result.path;
  std::vector<Eigen::Vector<double, 6>> twists;
  for (std::size_t k = 0; k < path.size(); ++k) {
    const PathStep& before = k > 0 && path[k - 1].has_pose() ? path[k - 1] : path[k];
    const PathStep& after = k + 1 < path.size() && path[k + 1].has_pose() ? path[k + 1] : path[k];
    Eigen::Vector<double, 6> twist = Eigen::Vector<double, 6>::Zero();
    if (const double dt_s = after.t_s - before.t_s; path[k].has_pose() && dt_s > 0.0) {
      const Rigid3 one = before.world_from_cam, other = after.world_from_cam;
      twist << path[k].world_from_cam.rotation.conjugate() * (other.translation - one.translation) / dt_s,
          log_so3(one.rotation.conjugate() * other.rotation) / dt_s;
    }
    twists.push_back(twist);
  }
  for (std::size_t k = 0; k < path.size(); ++k)
    result.path[k].cov += sigma_s * sigma_s * twists[k] * twists[k].transpose();
  for (GivenNumber& clock : result.given) {
    if (clock.name != "clock") continue;
    clock.moves /= std::hypot(1.0, clock.moves * sigma_s);
    clock.sigma = sigma_s;
  }
}

void add_path_error(Localization& result) {
  if (result.truth.empty()) return;
  std::vector<TimedPose> path;
  std::vector<Eigen::Matrix<double, 6, 6>> covs;
  for (const PathStep& step : result.path) {
    if (!step.has_pose()) continue;
    path.push_back({step.t_s, step.world_from_cam});
    covs.push_back(step.cov);
  }
  if (!path.empty()) result.error = path_error(path, result.truth, result.scale_known, covs);
}

/// A flat target in the plane of x and y, and most poses on the side from which it cannot be seen.
bool is_behind(std::span<const PathStep> path, std::span<const KnownPoint> target, bool seen_from_plus_z) {
  if (target.size() < 3) return false;
  Eigen::AlignedBox3d box;
  for (const KnownPoint& point : target) box.extend(point.point_in_world);
  const Eigen::Vector3d size = box.sizes();
  constexpr double flat = 0.05;
  if (!(size.z() < flat * size.head<2>().maxCoeff())) return false;
  double balance = 0.0;
  for (const PathStep& step : path) {
    if (!step.has_pose()) continue;
    const bool is_plus = step.world_from_cam.translation.z() > box.center().z();
    balance += is_plus == seen_from_plus_z ? -1.0 : 1.0;
  }
  return balance > 0.0;
}

namespace {

bool is_of_targets_points(const GivenNumber& given) {
  return given.name == "shape of the target" || given.name == "speed of the target" ||
         given.name == "rotation of the target";
}

std::size_t num_known_fit(const SmoothedPath& smoothed, std::span<const MapPoint> map) {
  std::set<long> known;
  for (const MapPoint& point : map)
    if (point.is_known) known.insert(point.id);
  return static_cast<std::size_t>(
      std::ranges::count_if(smoothed.residuals, [&](const PlacedResidual& each) { return known.contains(each.id); }));
}

}  // namespace

void take_over(const SmoothedPath& smoothed, Localization& result) {
  result.is_smoothed = true;
  result.given = smoothed.given;
  const bool is_other_path = result.num_restarts > 0 || (smoothed.is_lens_freed && !result.is_of_images);
  result.radial = smoothed.radial;
  if (result.is_of_images) {
    std::erase_if(result.given,
                  is_of_targets_points);  // the appearance of patches of four corners changes with the viewpoint
  }
  result.lens_pull = smoothed.lens_pull;
  result.widened = smoothed.widened;
  result.is_from_one_place = smoothed.is_from_one_place;
  if (smoothed.is_lens_freed) {
    result.given_camera = result.camera;
    result.lens_params.clear();
    for (const int index : smoothed.estimated)
      result.lens_params.push_back(param_names(smoothed.camera.lens)[static_cast<std::size_t>(index)]);
  }
  result.camera = smoothed.camera;
  result.sigma_lens = smoothed.sigma_lens;
  if (is_other_path) {  // observations that the filter rejected before a restart, or with another lens, may be used now
    result.num_used = smoothed.residuals.size();
    result.num_gated = smoothed.num_dropped;
    // If only some frames were solved for, observations of the others have no residuals: the filter's count remains.
    if (result.smoothed_every == 1)
      result.num_known_gated = result.num_known - std::min(result.num_known, num_known_fit(smoothed, result.map));
    result.nis_per_dof = smoothed.chi2_per_dof;
  }
  result.saved_map.frame = smoothed.frame;
  for (std::size_t i = 0; i < smoothed.ids.size(); ++i) {
    const auto at = std::ranges::find(result.map, smoothed.ids[i], &MapPoint::id);
    if (at == result.map.end()) continue;
    at->point_in_world = smoothed.points[i];
    at->cov = smoothed.point_covs[i];
    at->cov_in_map = smoothed.covs_in_map[i];
  }
}

double known_shift(std::span<const MapPoint> map, std::span<const KnownPoint> given) {
  double sum = 0.0, num = 0.0;
  for (const KnownPoint& point : given) {
    const auto at = std::ranges::find(map, point.id, &MapPoint::id);
    if (at == map.end() || at->num_seen == 0) continue;
    sum += (at->point_in_world - point.point_in_world).squaredNorm() / (point.sigma_m * point.sigma_m);
    num += 3.0;
  }
  return num > 0.0 ? sum / num : std::numeric_limits<double>::quiet_NaN();
}

}  // namespace alidade
