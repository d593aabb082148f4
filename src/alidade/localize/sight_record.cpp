#include "alidade/localize/sight_record.h"

#include <algorithm>
#include <set>

namespace alidade {

void SightRecord::begin(std::size_t frame) {
  first_frame_ = frame;
  ++num_begun_;
  used_.clear();
  births_.clear();
}

void SightRecord::take(std::size_t frame, std::span<const FeatureSight> sights, std::span<const SightOutcome> outcomes,
                       double sigma_px) {
  for (std::size_t i = 0; i < sights.size(); ++i) {
    if (outcomes[i] != SightOutcome::used) continue;
    used_.push_back({frame, sights[i].id, sights[i].px, sights[i].sigma_px > 0.0 ? sights[i].sigma_px : sigma_px});
  }
}

void SightRecord::entered(std::size_t frame, const FeatureSight& sight, const RangePrior& prior, double sigma_px) {
  births_[sight.id] = {frame, prior};
  used_.push_back({frame, sight.id, sight.px, sigma_px});
}

std::optional<SmootherProblem> SightRecord::problem(const Camera& camera, const LocalizeConfig& config,
                                                    std::span<const PathStep> path, const LocalizationFilter& filter,
                                                    double period_s) const {
  SmootherProblem problem;
  std::set<long> known, seen;
  for (const UsedSight& sight : used_) seen.insert(sight.id);
  for (const Feature& feature : filter.features()) {
    if (feature.kind != FeatureKind::xyz || !seen.contains(feature.id)) continue;
    SmootherPoint point;
    point.id = feature.id;
    point.point_in_world = feature.values.head<3>();
    const auto told = std::ranges::find(config.target, feature.id, &KnownPoint::id);
    const auto birth = births_.find(feature.id);
    if (told != config.target.end()) {
      point.told_in_world = told->point_in_world;
      point.sigma_m = told->sigma_m;
      known.insert(feature.id);
    } else if (birth != births_.end()) {
      point.first_frame = birth->second.frame - first_frame_;
      point.range = birth->second.range;
    } else {
      continue;
    }
    problem.points.push_back(point);
  }
  constexpr double most_work = 2e8;  // frames times numbers of the map, squared: seconds
  const double num_frames = static_cast<double>(path.size() - first_frame_);
  const double num_map = 3.0 * static_cast<double>(problem.points.size()) + 20.0;
  if (known.empty() || num_frames * num_map * num_map > most_work) return std::nullopt;
  for (std::size_t k = first_frame_; k < path.size(); ++k) {
    problem.t_s.push_back(path[k].t_s);
    problem.world_from_cam.push_back(path[k].world_from_cam);
  }
  for (UsedSight sight : used_) {
    const auto birth = births_.find(sight.id);
    if (!known.contains(sight.id) && (birth == births_.end() || sight.frame < birth->second.frame)) continue;
    sight.frame -= first_frame_;
    problem.sights.push_back(sight);
  }
  problem.camera = camera;
  if (num_begun_ == 1) problem.start = config.start;
  problem.sigma_speed_m_s = config.sigma_speed_m_s;
  problem.sigma_rate_rad_s = config.sigma_rate_rad_s;
  problem.period_s = period_s;
  problem.sigma_scale = config.sigma_scale;
  problem.filter = config.filter;
  return problem;
}

}  // namespace alidade
