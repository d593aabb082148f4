#include "alidade/localize/path/whole_path.h"

#include <algorithm>
#include <cmath>

#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/checks/summary.h"
#include "alidade/localize/path/loop_closure.h"
#include "alidade/localize/path/remaining_points.h"

namespace alidade {
namespace {

/// What of each frame fits the smoothed path: frames that the filter had lost may be determined by their observations
/// there.
void judge_frames(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                  Localization& result) {
  std::vector<std::size_t> num_fit(result.path.size(), 0);
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[first_frame + residual.frame];
  for (std::size_t k = first_frame; k < result.path.size(); ++k) {
    PathStep& step = result.path[k];
    const bool was_lost = step.event == FrameEvent::predicted || step.event == FrameEvent::waiting;
    if (was_lost && num_fit[k] >= min_observations) step.event = FrameEvent::tracked;
    std::size_t num_of_map = 0;
    for (const FeatureObservation& observation : frames[k].observations)
      num_of_map += std::ranges::binary_search(smoothed.ids, observation.id) ? 1 : 0;
    result.num_unexplained += 2 * num_fit[k] < num_of_map ? 1 : 0;
  }
}

/// Without a target a second initial guess is tried where errors last from frame to frame: as they do on real films,
/// and in the wrong one of two minima.
std::optional<SmoothedPath> best_path(const SmootherProblem& problem) {
  constexpr std::size_t max_frames = 600;  // farther on all depths alike are no guess
  auto smoothed = smoothed_path(problem);
  if (problem.gauge != PathGauge::similarity || problem.world_from_cam.size() > max_frames) return smoothed;
  if (smoothed && !smoothed->structure.has_colour()) return smoothed;
  const auto flat = flat_start(problem);
  if (!flat) return smoothed;
  auto other = smoothed_path(*flat);
  const double gate = problem.filter.gate;
  const bool is_better = other && (!smoothed || cost_of(*other, gate) < cost_of(*smoothed, gate));
  return is_better ? std::move(other) : std::move(smoothed);
}

/// The path of `result` smoothed. None, and no change, where that does not settle.
std::optional<SmoothedPath> smooth(const SmootherProblem& problem, std::span<const ObservationFrame> frames,
                                   Localization& result) {
  auto smoothed = best_path(problem);
  if (!smoothed) return std::nullopt;
  result.residuals = smoothed->structure;
  for (std::size_t k = 0; k < smoothed->cov.size(); ++k) {
    PathStep& step = result.path[problem.first_frame + k];
    step.world_from_cam = smoothed->world_from_cam[k];
    step.cov = smoothed->cov[k];
  }
  judge_frames(*smoothed, problem.first_frame, frames, result);
  return smoothed;
}

/// With its loops closed; where that does not settle, without.
std::optional<SmoothedPath> smooth_with_loops(const Recording& recording, SmootherProblem& problem,
                                              Localization& result) {
  const std::vector<ObservationFrame>& frames = recording.frames.frames();
  SmootherProblem closed = problem;
  const LoopClosure closure = close_loops(recording.number_of, max_points_at_once(frames.size()), closed);
  result.num_loops = closure.num_loops;
  result.num_loops_rejected = closure.num_rejected;
  if (closure.num_joined > 0)
    if (auto smoothed = smooth(closed, frames, result)) {
      problem = std::move(closed);
      return smoothed;
    }
  result.num_loops = 0;
  return smooth(problem, frames, result);
}

/// A path up to scale, once more where sensors beside the camera say how long it is: each point's distance from where
/// it was first seen is believed to be what it is now, in metres, so vaguely that all of them together say the scale
/// and its σ, and nothing else. What a unit was before in metres.
double solve_in_metres(const Recording& recording, const LocalizeConfig& config, SmootherProblem problem,
                       SmoothedPath& smoothed, Localization& result) {
  if (!config.target.points.empty()) return 1.0;
  std::vector<MapPoint> map;
  for (std::size_t i = 0; i < smoothed.ids.size(); ++i)
    map.push_back({smoothed.ids[i], smoothed.points[i], smoothed.point_covs[i], false, 0});
  read_scales(config, map, result);
  const auto read = scale_of(result);
  if (!read) return 1.0;
  for (std::size_t k = 0; k < problem.world_from_cam.size(); ++k) {
    problem.world_from_cam[k] = smoothed.world_from_cam[k];
    problem.world_from_cam[k].translation *= read->scale;
  }
  const double sigma_rel = read->sigma_rel * std::sqrt(static_cast<double>(smoothed.ids.size()));
  std::vector<SmootherPoint> points;
  for (SmootherPoint& point : problem.points) {
    const auto at = std::ranges::lower_bound(smoothed.ids, point.id);
    if (at == smoothed.ids.end() || *at != point.id) continue;
    point.point_in_world = read->scale * smoothed.points[static_cast<std::size_t>(at - smoothed.ids.begin())];
    const Eigen::Vector3d away = point.point_in_world - problem.world_from_cam[point.first_frame].translation;
    point.range = RangePrior{away.norm(), sigma_rel};
    points.push_back(point);
  }
  problem.points = std::move(points);
  if (problem.gauge == PathGauge::similarity) problem.gauge = PathGauge::motion;
  Localization again = result;
  auto in_metres = smooth(problem, recording.frames.frames(), again);
  if (!in_metres) return 1.0;
  result = std::move(again);
  smoothed = std::move(*in_metres);
  result.is_scale_read = result.scale_known = true;
  return read->scale;
}

}  // namespace

std::optional<WholePath> whole_path(const Recording& recording, const LocalizeEngine& engine,
                                    const LocalizeConfig& config, Localization& result) {
  if (!engine.has_begun()) return std::nullopt;
  const KeptFrames& frames = recording.frames;
  Localization kept = result;
  kept.path = frames.steps(result.path);
  auto problem = recording.record.of_every(frames).problem(engine.camera(), config, frames.frames(), kept.path,
                                                           engine.best(), recording.gone, engine.start_without_target(),
                                                           recording.period_s, !recording.number_of.empty());
  if (!problem) return std::nullopt;
  problem->frees_lens = result.is_of_images;
  auto smoothed = smooth_with_loops(recording, *problem, kept);
  if (!smoothed) return std::nullopt;
  const double scale = solve_in_metres(recording, config, *problem, *smoothed, kept);
  std::vector<PathStep> path = std::move(result.path);
  result = std::move(kept);
  frames.put_back(result.path, path);
  result.path = std::move(path);
  result.num_unexplained *= frames.stride();
  result.smoothed_every = frames.stride();
  return WholePath{std::move(*smoothed), problem->first_frame, scale};
}

void take_over(const std::optional<WholePath>& whole, const Recording& recording, const LocalizeEngine& engine,
               const LocalizeConfig& config, Localization& result) {
  if (engine.has_begun())
    for (const GonePoint& each : recording.gone) {
      result.map.push_back(each.point);
      result.map.back().num_seen = recording.num_used(each.point.id);
    }
  if (!whole) return;
  for (MapPoint& point : result.map) {
    point.point_in_world *= whole->scale;
    point.cov *= whole->scale * whole->scale;
  }
  locate_remaining(whole->smoothed, whole->first_frame, recording.frames.frames(), config.filter.sigma_px,
                   config.filter.gate, result.map);
  take_over(whole->smoothed, result);
}

}  // namespace alidade
