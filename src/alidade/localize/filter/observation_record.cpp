#include "alidade/localize/filter/observation_record.h"

#include <algorithm>
#include <cmath>
#include <set>

#include "alidade/localize/known_pose.h"
#include "alidade/localize/path/path_resection.h"

namespace alidade {
namespace {

/// Distances that were merely assumed share their error: with their configured σ, hundreds of them together
/// would determine the scale of the world.
RangePrior vague(RangePrior range, long id, bool sets_unit, const LocalizeConfig& config) {
  constexpr double hardly_given = 5.0;
  const bool is_given =
      config.start && std::ranges::find(config.start->depths, id, &GivenDepth::id) != config.start->depths.end();
  if (!is_given && !sets_unit && config.new_points != NewPoints::delayed)
    range.sigma_rel = std::max(range.sigma_rel, hardly_given);
  return range;
}

/// Limits the number of points that coexist (from first to last observation) to `most`, to bound the run time;
/// known points first, then those with the most observations. False if that leaves too few.
[[nodiscard]] bool thin(std::span<const ObservationFrame> frames, double most, std::vector<SmootherPoint>& points) {
  struct Life {
    std::size_t point = 0, first = 0, last = 0, num = 0;
  };
  std::map<long, Life> lives;
  for (std::size_t i = 0; i < points.size(); ++i) lives[points[i].id].point = i;
  for (std::size_t k = 0; k < frames.size(); ++k) {
    for (const FeatureObservation& observation : frames[k].observations) {
      const auto at = lives.find(observation.id);
      if (at == lives.end()) continue;
      if (at->second.num++ == 0) at->second.first = k;
      at->second.last = k;
    }
  }
  constexpr double enough = 25.0;
  std::vector<Life> by_use;
  for (const auto& [id, life] : lives)
    if (life.num > 0) by_use.push_back(life);
  std::ranges::stable_sort(by_use, [&](const Life& a, const Life& b) {
    const bool known_a = points[a.point].given_in_world.has_value(),
               known_b = points[b.point].given_in_world.has_value();
    return known_a != known_b ? known_a : a.num > b.num;
  });
  std::vector<int> num_at(frames.size(), 0);
  std::vector<SmootherPoint> kept;
  bool has_all = true;
  for (const Life& life : by_use) {
    const auto begin = num_at.begin() + static_cast<std::ptrdiff_t>(life.first),
               end = num_at.begin() + static_cast<std::ptrdiff_t>(life.last) + 1;
    has_all = has_all && *std::max_element(begin, end) + 1 <= most;
    if (!(*std::max_element(begin, end) + 1 <= most)) continue;
    std::for_each(begin, end, [](int& num) { ++num; });
    kept.push_back(points[life.point]);
  }
  points = std::move(kept);
  return has_all || most >= enough;
}

struct PlaceOfPoint {
  Eigen::Vector3d point_in_world;
  Eigen::Matrix3d cov;
};

/// Poses and observations of a smoothing problem, built from its last frame back to its first.
class BackwardPath {
 public:
  BackwardPath(const Camera& camera, const LocalizeConfig& config, const LocalizationFilter& filter,
               std::span<const GonePoint> gone, const SmootherProblem& problem)
      : camera_(camera), config_(config) {
    for (const SmootherPoint& point : problem.points) places_[point.id] = {point.point_in_world, cov_of(filter, point)};
    for (const GonePoint& each : gone)
      if (each.is_linear) places_[each.point.id] = {each.point.point_in_world, each.point.cov};
  }

  /// Adds the pose of a frame and its observations in their order; `path` is the filter's. Returns whether the
  /// observations determine the pose.
  bool take(const ObservationFrame& frame, const PathStep& path);

  /// Takes all frames down to `first_frame`, and earlier ones that the target determines. Index of the last one taken.
  std::size_t take_back(std::span<const ObservationFrame> frames, std::span<const PathStep> path,
                        std::size_t first_frame);

  std::vector<Rigid3> world_from_cam;                      ///< Last frame first.
  std::vector<std::vector<UsedObservation>> observations;  ///< Their `frame` is not set yet.

 private:
  void give_back();  ///< Removes the frame taken last.
  /// A given point may be off in the map's frame by more than its own σ, if a filter lost it as a mismatch.
  [[nodiscard]] static Eigen::Matrix3d cov_of(const LocalizationFilter& filter, const SmootherPoint& point) {
    const auto place = filter.place(point.id);
    return place ? place->cov : Eigen::Matrix3d::Zero().eval();
  }
  [[nodiscard]] std::vector<Rigid3> begin_at(const PathStep& path) const;

  const Camera& camera_;
  const LocalizeConfig& config_;
  std::map<long, PlaceOfPoint> places_;
};

/// Initial guesses: the filter's pose, that of the following frame, and that one extrapolated at constant velocity.
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
  const double gate = 4.0 * config_.filter.gate;  // wide: poses and positions still change in the joint solve
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

std::size_t BackwardPath::take_back(std::span<const ObservationFrame> frames, std::span<const PathStep> path,
                                    std::size_t first_frame) {
  std::size_t first = path.size();
  while (first > first_frame) {
    --first;
    (void)take(frames[first], path[first]);
  }
  for (; first > 0 && !config_.start && !config_.target.points.empty(); --first) {
    if (take(frames[first - 1], path[first - 1])) continue;
    give_back();
    break;
  }
  return first;
}

void BackwardPath::give_back() {
  world_from_cam.pop_back();
  observations.pop_back();
}

/// A filter's unit of length grows while depths are uncertain. Where the assumed distances of the first points define
/// the unit, rescales the path to them: least squares over the inverse distances.
void rescale(SmootherProblem& problem) {
  constexpr double is_unit = 1.0;  // for all other assumed distances σ is five times the distance
  double products = 0.0, squares = 0.0;
  for (const SmootherPoint& point : problem.points) {
    if (!point.range || !(point.range->sigma_rel < is_unit)) continue;
    const double weight = point.range->range_m / point.range->sigma_rel;
    const double distance = (point.point_in_world - problem.world_from_cam[point.first_frame].translation).norm();
    products += weight * weight / (distance * point.range->range_m);
    squares += weight * weight / (distance * distance);
  }
  const double scale = squares / products;
  if (!(scale > 0.0) || !std::isfinite(scale)) return;
  for (Rigid3& pose : problem.world_from_cam) pose.translation *= scale;
  for (SmootherPoint& point : problem.points) point.point_in_world *= scale;
}

/// Adds times, poses and observations in order of time. Returns the ids of the observed points.
std::set<long> add_frames(const BackwardPath& back, std::span<const PathStep> path, const std::set<std::size_t>& jumps,
                          SmootherProblem& problem) {
  std::set<long> seen;
  for (std::size_t k = 0; k < back.world_from_cam.size(); ++k) {
    const std::size_t at = back.world_from_cam.size() - 1 - k, frame = problem.first_frame + k;
    problem.t_s.push_back(path[frame].t_s);
    problem.is_jump.push_back(jumps.contains(frame));
    problem.world_from_cam.push_back(back.world_from_cam[at]);
    for (UsedObservation observation : back.observations[at]) {
      observation.frame = k;
      seen.insert(observation.id);
      problem.observations.push_back(observation);
    }
  }
  return seen;
}

}  // namespace

bool is_settled(const Feature& feature, const LocalizationFilter& filter, const LocalizeConfig& config) {
  if (feature.kind == FeatureKind::xyz) return true;
  constexpr double min_parallax_rad = 0.03, min_rho = 1e-2;
  if (!config.target.points.empty() || !(feature.values[5] > min_rho)) return false;
  const Eigen::Vector3d place = place_of(feature).point_in_world;
  const Eigen::Vector3d first = place - feature.values.head<3>();
  const Eigen::Vector3d now = place - filter.motion().world_from_cam.translation;
  return std::atan2(first.cross(now).norm(), first.dot(now)) > min_parallax_rad;
}

double max_points_at_once(std::size_t num_frames) {
  constexpr double max_work = 2e8;  // frames × (components at one time)²: a run time of seconds
  constexpr double num_shared = 24.0;
  return (std::sqrt(max_work / static_cast<double>(num_frames)) - num_shared) / 3.0;
}

void ObservationRecord::begin(std::size_t frame) {
  if (num_begun_++ == 0) first_frame_ = frame;
  last_begun_ = frame;
}

ObservationRecord ObservationRecord::of_every(const KeptFrames& frames) const {
  ObservationRecord record = *this;
  record.first_frame_ = frames.index_of(first_frame_);
  record.last_begun_ = frames.index_of(last_begun_);
  for (auto& [id, birth] : record.births_) birth.frame = frames.index_of(birth.frame);
  record.jumps_.clear();
  for (const std::size_t jump : jumps_) record.jumps_.insert(frames.index_of(jump));
  return record;
}

void ObservationRecord::add_points(const LocalizeConfig& config, const LocalizationFilter& filter,
                                   SmootherProblem& problem) const {
  for (const Feature& feature : filter.features()) {
    if (!is_settled(feature, filter, config)) continue;
    SmootherPoint point;
    point.id = feature.id;
    point.point_in_world = place_of(feature).point_in_world;
    const auto given = std::ranges::find(config.target.points, feature.id, &KnownPoint::id);
    const auto birth = births_.find(feature.id);
    if (given != config.target.points.end()) {
      point.given_in_world = given->point_in_world;
      point.sigma_m = given->sigma_m;
    } else if (birth != births_.end()) {
      point.first_frame = birth->second.frame;
      point.range = vague(birth->second.range, feature.id, sets_unit(config, birth->second.frame), config);
    } else {
      continue;
    }
    problem.points.push_back(point);
  }
  for (const KnownPoint& given : config.target.points)
    if (!filter.has(given.id))
      problem.points.push_back({given.id, given.point_in_world, given.point_in_world, given.sigma_m, 0, {}, {}});
}

void ObservationRecord::add_gone(const LocalizeConfig& config, std::span<const GonePoint> gone,
                                 SmootherProblem& problem) const {
  for (const GonePoint& each : gone) {
    const auto birth = births_.find(each.point.id);
    if (!each.is_linear || birth == births_.end()) continue;
    SmootherPoint point;
    point.id = each.point.id;
    point.point_in_world = each.point.point_in_world;
    point.first_frame = birth->second.frame;
    point.range = vague(birth->second.range, each.point.id, sets_unit(config, birth->second.frame), config);
    problem.points.push_back(point);
  }
}

/// Sets what fixes the world frame: a start, a target, or the first camera.
void ObservationRecord::give_frame(const LocalizeConfig& config, const std::optional<StartHypothesis>& start,
                                   SmootherProblem& problem) const {
  const bool has_target = !config.target.points.empty();
  if (num_begun_ == 1 && (config.start || !has_target)) problem.start = start;  // else contradicted by the observations
  if (config.start || has_target) return;
  problem.gauge = PathGauge::similarity;
  rescale(problem);
  if (!start || problem.start) return;
  problem.start = start;  // even after restarts: the first camera defines the world frame
  problem.start->motion.world_from_cam = problem.world_from_cam.front();
}

std::optional<SmootherProblem> ObservationRecord::problem(
    const Camera& camera, const LocalizeConfig& config, std::span<const ObservationFrame> frames,
    std::span<const PathStep> path, const LocalizationFilter& filter, std::span<const GonePoint> gone,
    const std::optional<StartHypothesis>& start, double period_s, bool has_loops) const {
  SmootherProblem problem;
  add_points(config, filter, problem);
  add_gone(config, gone, problem);
  constexpr double of_all = 0.6;
  const double most = max_points_at_once(frames.size()) * (has_loops ? of_all : 1.0);
  if (!thin(frames, most, problem.points)) return std::nullopt;
  BackwardPath back(camera, config, filter, gone, problem);
  problem.first_frame = back.take_back(frames, path, first_frame_);
  for (SmootherPoint& point : problem.points) point.first_frame -= point.range ? problem.first_frame : 0;
  const std::set<long> seen = add_frames(back, path, jumps_, problem);
  std::erase_if(problem.points, [&](const SmootherPoint& point) { return !seen.contains(point.id); });
  std::ranges::sort(problem.points, {}, &SmootherPoint::id);
  const bool has_target = !config.target.points.empty();
  if (has_target &&
      std::ranges::none_of(problem.points, [](const SmootherPoint& point) { return point.given_in_world.has_value(); }))
    return std::nullopt;
  problem.camera = camera;
  give_frame(config, start, problem);
  problem.sigma_speed_m_s = config.sigma_speed_m_s;
  problem.sigma_rate_rad_s = config.sigma_rate_rad_s;
  problem.period_s = period_s;
  problem.sigma_scale = config.filter.sigma_scale;
  problem.filter = config.filter;
  return problem;
}

}  // namespace alidade
