#include "alidade/localize/observation_record.h"

#include <algorithm>
#include <set>

#include "alidade/localize/known_pose.h"
#include "alidade/localize/path_resection.h"

namespace alidade {
namespace {

struct PlaceOfPoint {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d cov;
};

/// Poses and observations of a problem, from its last frame to its first.
class BackwardPath {
 public:
  BackwardPath(const Camera& camera, const LocalizeConfig& config, const LocalizationFilter& filter,
               std::span<const GonePoint> gone, const SmootherProblem& problem)
      : camera_(camera), config_(config) {
    for (const SmootherPoint& point : problem.points) places_[point.id] = {point.point_in_world, cov_of(filter, point)};
    for (const GonePoint& each : gone)
      if (each.is_linear) places_[each.point.id] = {each.point.point_in_world, each.point.cov};
  }

  /// The pose of a frame, and its observations in their order; `path` is the filter's. Whether its observations hold
  /// it.
  bool take(const ObservationFrame& frame, const PathStep& path);

  void give_back();  ///< The frame taken last.

  std::vector<Rigid3> world_from_cam;                      ///< Last frame first.
  std::vector<std::vector<UsedObservation>> observations;  ///< Frames counted from none.

 private:
  /// A told point may be further from the map's frame than its own σ: a filter that took it for mismatched lost it.
  [[nodiscard]] static Eigen::Matrix3d cov_of(const LocalizationFilter& filter, const SmootherPoint& point) {
    const auto place = filter.place(point.id);
    return place ? place->cov : Eigen::Matrix3d::Zero().eval();
  }
  [[nodiscard]] std::vector<Rigid3> begin_at(const PathStep& path) const;

  const Camera& camera_;
  const LocalizeConfig& config_;
  std::map<long, PlaceOfPoint> places_;
};

/// The filter's pose, that of the frame after it, and that moved on as between the two after it.
std::vector<Rigid3> BackwardPath::begin_at(const PathStep& path) const {
  std::vector<Rigid3> begin;
  if (path.has_pose()) begin.push_back(path.world_from_cam);
  if (world_from_cam.empty()) return begin;
  begin.push_back(world_from_cam.back());
  if (world_from_cam.size() < 2) return begin;
  const Rigid3 step = world_from_cam[world_from_cam.size() - 2].inverse() * world_from_cam.back();
  begin.push_back(world_from_cam.back() * step);
  return begin;
}

bool BackwardPath::take(const ObservationFrame& frame, const PathStep& path) {
  std::vector<PlacedObservation> placed;
  std::vector<UsedObservation> used;
  for (const FeatureObservation& observation : frame.observations) {
    const auto place = places_.find(observation.id);
    if (place == places_.end()) continue;
    const double sigma_px = observation.sigma_px > 0.0 ? observation.sigma_px : config_.filter.sigma_px;
    placed.push_back({observation.px, sigma_px, place->second.point_in_world, place->second.cov});
    used.push_back({0, observation.id, observation.px, sigma_px});
  }
  std::vector<Rigid3> begin = begin_at(path);
  const double gate = 4.0 * config_.filter.gate;  // poses and places give way when all are solved for together
  auto found = resection(camera_, placed, begin, gate);
  constexpr double doubtful = 0.5;
  if (found && static_cast<double>(found->num_fit) < doubtful * static_cast<double>(placed.size())) {
    for (const StartHypothesis& start :
         poses_from_known(camera_, frame.observations, config_.target.points,
                          {config_.filter.sigma_px, config_.sigma_speed_m_s, config_.sigma_rate_rad_s}))
      begin.push_back(start.motion.world_from_cam);
    found = resection(camera_, placed, begin, gate);
  }
  for (std::size_t i = 0; i < used.size(); ++i) used[i].fits_start = found && found->fits[i];
  constexpr std::size_t min_fit = 4;
  world_from_cam.push_back(found ? found->world_from_cam : begin.front());
  observations.push_back(std::move(used));
  return found && found->num_fit >= min_fit && 2 * found->num_fit > placed.size();
}

void BackwardPath::give_back() {
  world_from_cam.pop_back();
  observations.pop_back();
}

}  // namespace

void ObservationRecord::begin(std::size_t frame) {
  if (num_begun_++ == 0) first_frame_ = frame;
}

void ObservationRecord::add_points(const LocalizeConfig& config, const LocalizationFilter& filter,
                                   SmootherProblem& problem) const {
  for (const Feature& feature : filter.features()) {
    if (feature.kind != FeatureKind::xyz) continue;
    SmootherPoint point;
    point.id = feature.id;
    point.point_in_world = feature.values.head<3>();
    const auto told = std::ranges::find(config.target.points, feature.id, &KnownPoint::id);
    const auto birth = births_.find(feature.id);
    if (told != config.target.points.end()) {
      point.told_in_world = told->point_in_world;
      point.sigma_m = told->sigma_m;
    } else if (birth != births_.end()) {
      point.first_frame = birth->second.frame;
      point.range = birth->second.range;
    } else {
      continue;
    }
    problem.points.push_back(point);
  }
}

void ObservationRecord::add_gone(std::span<const GonePoint> gone, SmootherProblem& problem) const {
  for (const GonePoint& each : gone) {
    const auto birth = births_.find(each.point.id);
    if (!each.is_linear || birth == births_.end()) continue;
    SmootherPoint point;
    point.id = each.point.id;
    point.point_in_world = each.point.point_in_world;
    point.first_frame = birth->second.frame;
    point.range = birth->second.range;
    problem.points.push_back(point);
  }
}

std::optional<SmootherProblem> ObservationRecord::problem(const Camera& camera, const LocalizeConfig& config,
                                                          std::span<const ObservationFrame> frames,
                                                          std::span<const PathStep> path,
                                                          const LocalizationFilter& filter,
                                                          std::span<const GonePoint> gone, double period_s) const {
  SmootherProblem problem;
  add_points(config, filter, problem);
  add_gone(gone, problem);
  constexpr double max_work = 2e8;  // frames times numbers of the map, squared: seconds
  const double num_frames = static_cast<double>(path.size() - first_frame_);
  const double num_map = 3.0 * static_cast<double>(problem.points.size()) + 20.0;
  if (num_frames * num_map * num_map > max_work) return std::nullopt;
  BackwardPath back(camera, config, filter, gone, problem);
  std::size_t first = path.size();
  while (first > first_frame_) {
    --first;
    (void)back.take(frames[first], path[first]);
  }
  for (; first > 0 && !config.start; --first) {
    if (back.take(frames[first - 1], path[first - 1])) continue;
    back.give_back();
    break;
  }
  problem.first_frame = first;
  for (SmootherPoint& point : problem.points) point.first_frame -= point.range ? first : 0;
  std::set<long> seen;
  for (std::size_t k = 0; k < back.world_from_cam.size(); ++k) {
    const std::size_t at = back.world_from_cam.size() - 1 - k;
    problem.t_s.push_back(path[first + k].t_s);
    problem.world_from_cam.push_back(back.world_from_cam[at]);
    for (UsedObservation observation : back.observations[at]) {
      observation.frame = k;
      seen.insert(observation.id);
      problem.observations.push_back(observation);
    }
  }
  std::erase_if(problem.points, [&](const SmootherPoint& point) { return !seen.contains(point.id); });
  std::ranges::sort(problem.points, {}, &SmootherPoint::id);
  if (std::ranges::none_of(problem.points, [](const SmootherPoint& point) { return point.told_in_world.has_value(); }))
    return std::nullopt;
  problem.camera = camera;
  if (num_begun_ == 1 && config.start)
    problem.start = StartHypothesis{config.start->motion, config.start->cov};  // else the observations contradicted it
  problem.sigma_speed_m_s = config.sigma_speed_m_s;
  problem.sigma_rate_rad_s = config.sigma_rate_rad_s;
  problem.period_s = period_s;
  problem.sigma_scale = config.filter.sigma_scale;
  problem.filter = config.filter;
  return problem;
}

}  // namespace alidade
