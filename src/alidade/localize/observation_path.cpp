#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/checks/summary.h"
#include "alidade/localize/observation_localizer.h"
#include "alidade/localize/path/left_out_points.h"
#include "alidade/localize/path/loop_closure.h"
#include "alidade/localize/path/smooth.h"

// What comes of all frames together: the path with its loops closed, in metres where sensors say them, and the map.

namespace alidade {

/// With its loops closed; where that does not settle, without.
std::optional<SmoothedPath> ObservationLocalizer::smooth_with_loops(SmootherProblem& problem,
                                                                    Localization& result) const {
  SmootherProblem closed = problem;
  const LoopClosure closure = close_loops(episodes_.number_of(), max_points_at_once(frames_.frames().size()), closed);
  result.num_loops = closure.num_loops;
  result.num_loops_rejected = closure.num_rejected;
  if (closure.num_joined > 0)
    if (auto smoothed = smooth(closed, frames_.frames(), result)) {
      problem = std::move(closed);
      return smoothed;
    }
  result.num_loops = 0;
  return smooth(problem, frames_.frames(), result);
}

/// A path up to scale, once more where sensors beside the camera say how long it is: each point's distance from where
/// it was first seen is believed to be what it is now, in metres, so vaguely that all of them together say the scale
/// and its σ, and nothing else. What a unit was before in metres.
double ObservationLocalizer::solve_in_metres(SmootherProblem problem, std::optional<SmoothedPath>& smoothed,
                                             Localization& result) const {
  if (!config_.target.points.empty()) return 1.0;
  std::vector<MapPoint> map;
  for (std::size_t i = 0; i < smoothed->ids.size(); ++i)
    map.push_back({smoothed->ids[i], smoothed->points[i], smoothed->point_covs[i], false, 0});
  read_scales(config_, map, result);
  const auto read = scale_of(result);
  if (!read) return 1.0;
  for (std::size_t k = 0; k < problem.world_from_cam.size(); ++k) {
    problem.world_from_cam[k] = smoothed->world_from_cam[k];
    problem.world_from_cam[k].translation *= read->scale;
  }
  const double sigma_rel = read->sigma_rel * std::sqrt(static_cast<double>(smoothed->ids.size()));
  std::vector<SmootherPoint> points;
  for (SmootherPoint& point : problem.points) {
    const auto at = std::ranges::lower_bound(smoothed->ids, point.id);
    if (at == smoothed->ids.end() || *at != point.id) continue;
    point.point_in_world = read->scale * smoothed->points[static_cast<std::size_t>(at - smoothed->ids.begin())];
    const Eigen::Vector3d away = point.point_in_world - problem.world_from_cam[point.first_frame].translation;
    point.range = RangePrior{away.norm(), sigma_rel};
    points.push_back(point);
  }
  problem.points = std::move(points);
  if (problem.gauge == PathGauge::similarity) problem.gauge = PathGauge::motion;
  Localization again = result;
  auto in_metres = smooth(problem, frames_.frames(), again);
  if (!in_metres) return 1.0;
  result = std::move(again);
  smoothed = std::move(in_metres);
  result.is_scale_read = result.scale_known = true;
  return read->scale;
}

/// From the frames that were kept for it; those between them follow.
std::optional<ObservationLocalizer::WholePath> ObservationLocalizer::smoothed_as_a_whole(Localization& result) const {
  Localization kept = result;
  kept.path = frames_.steps(result.path);
  auto problem = record_.of_every(frames_).problem(
      engine_.camera(), config_, frames_.frames(), kept.path, engine_.best(), points_.gone(engine_.best()),
      engine_.start_without_target(), period_s(), !episodes_.number_of().empty());
  if (!problem) return std::nullopt;
  auto smoothed = smooth_with_loops(*problem, kept);
  if (!smoothed) return std::nullopt;
  const double scale = solve_in_metres(*problem, smoothed, kept);
  std::vector<PathStep> path = std::move(result.path);
  result = std::move(kept);
  frames_.put_back(result.path, path);
  result.path = std::move(path);
  result.num_unexplained *= frames_.stride();
  result.smoothed_every = frames_.stride();
  return WholePath{std::move(*smoothed), problem->first_frame, scale};
}

void ObservationLocalizer::sum_up(Localization& result) const {
  const LocalizeTarget& target = config_.target;
  result.sigma_px = config_.filter.sigma_px;
  result.is_board = target.board.has_value();
  std::optional<WholePath> whole;
  if (smooths() && engine_.has_begun()) whole = smoothed_as_a_whole(result);
  engine_.sum_up([this](long id) { return points_.num_used(id); }, result);
  result.num_left = num_left_;
  if (engine_.has_begun())
    for (const GonePoint& each : points_.gone(engine_.best())) {
      result.map.push_back(each.point);
      result.map.back().num_seen = points_.num_used(each.point.id);
    }
  if (whole) {
    for (MapPoint& point : result.map) {
      point.point_in_world *= whole->scale;
      point.cov *= whole->scale * whole->scale;
    }
    place_left_out(whole->smoothed, whole->first_frame, frames_.frames(), config_.filter.sigma_px, config_.filter.gate,
                   result.map);
    take_over(whole->smoothed, result);
  }
  join_episodes(episodes_, whole ? std::span<const long>(whole->smoothed.ids) : std::span<const long>(), result.map);
  result.known_shift = known_shift(result.map, target.points);
  result.is_behind = is_behind(result.path, target.points, target.seen_from_plus_z);
}

}  // namespace alidade
