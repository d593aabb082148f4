#include "alidade/network/moving_start.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <functional>
#include <numeric>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr double min_share = 0.5;  // of the observations, that must agree
constexpr double max_miss_px = 12.0;

double start_strength(const ObservationPair& pair) {
  return pair.share * std::sqrt(static_cast<double>(pair.num_common));
}

double time_of(const MovingStart::Placed& camera, double t_s, double mid_s) {
  return t_s + camera.offset_s + (camera.rate - 1.0) * (t_s - mid_s);
}

struct SeenRay {
  Eigen::Vector3d origin, along;
  double max_miss;  ///< Sine.
};

/// The point nearest to all rays; none where they are nearly parallel or miss each other.
std::optional<Eigen::Vector3d> meeting_point(const std::vector<SeenRay>& rays) {
  constexpr double min_sine = 0.02;
  Eigen::Matrix3d A = Eigen::Matrix3d::Zero();
  Eigen::Vector3d b = Eigen::Vector3d::Zero();
  double widest = 0.0;
  for (const SeenRay& ray : rays) {
    const Eigen::Matrix3d across = Eigen::Matrix3d::Identity() - ray.along * ray.along.transpose();
    A += across;
    b += across * ray.origin;
    widest = std::max(widest, rays.front().along.cross(ray.along).norm());
  }
  if (rays.size() < 2 || !(widest > min_sine)) return std::nullopt;
  const Eigen::Vector3d point = solve_symmetric(A, b);
  for (const SeenRay& ray : rays) {
    const Eigen::Vector3d to_point = point - ray.origin;
    if (!(to_point.dot(ray.along) > 0.0) || !(to_point.cross(ray.along).norm() < ray.max_miss * to_point.norm()))
      return std::nullopt;
  }
  return point;
}

/// The camera's best clock and pose around what a pair says: offsets to ±0.4 s, rates to ±0.2 %.
std::optional<Resection> best_resection(const ObservationSeries& series, const MovingStart& start, double around_s,
                                        bool searches, MovingStart::Placed& camera) {
  std::optional<Resection> best;
  const auto consider = [&](double offset_s, double rate) {
    const auto found = resection(series, start.t_s, start.path, offset_s, rate);
    if (!found || (best && !(found->share > best->share))) return;
    best = found;
    camera.offset_s = offset_s;
    camera.rate = rate;
  };
  consider(around_s, 1.0);
  if (!searches) return best;
  for (int k = -8; k <= 8; ++k) consider(around_s + 0.05 * k, 1.0);
  const double centre_s = camera.offset_s;
  for (int drift = -4; drift <= 4; ++drift)
    for (int k = -3; k <= 3; ++k) consider(centre_s + 0.03 * k, 1.0 + 0.0005 * drift);
  return best;
}

std::size_t num_placed(const MovingStart& start) {
  return static_cast<std::size_t>(std::ranges::count(start.cameras, true, &MovingStart::Placed::placed));
}

bool place_next(std::span<const ObservationSeries> series, const std::vector<ObservationPair>& pairs, bool searches,
                std::vector<bool>& tried, MovingStart& start) {
  const ObservationPair* next = nullptr;
  for (const ObservationPair& pair : pairs) {
    const bool has_first = start.cameras[pair.first].placed, has_second = start.cameras[pair.second].placed;
    if (has_first == has_second || tried[has_first ? pair.second : pair.first]) continue;
    if (!next || start_strength(pair) > start_strength(*next)) next = &pair;
  }
  if (!next) return false;
  const bool has_first = start.cameras[next->first].placed;
  const std::size_t known = has_first ? next->first : next->second, added = has_first ? next->second : next->first;
  tried[added] = true;
  MovingStart::Placed& camera = start.cameras[added];
  const double around_s = start.cameras[known].offset_s + (has_first ? next->offset_s : -next->offset_s);
  const auto best = best_resection(series[added], start, around_s, searches, camera);
  camera.placed = best && best->share >= min_share;
  if (!camera.placed) {
    camera.reason = searches ? "at no difference of clocks do half of its observations agree with the other cameras'"
                             : "by one clock fewer than half of its observations agree with the other cameras'";
    return true;
  }
  camera.cam_from_world = best->cam_from_world;
  camera.reason.clear();
  return true;
}

/// Pairs of cameras with their clocks' differences. What pairs that agree well already determine is not searched again.
std::vector<ObservationPair> given_pairs(std::span<const ObservationSeries> series, double search_s,
                                         const Progress& progress) {
  constexpr double sure_share = 0.8;
  constexpr std::size_t sure_common = 100;
  std::vector<ObservationPair> pairs;
  std::vector<std::size_t> group(series.size());
  std::iota(group.begin(), group.end(), std::size_t{0});
  for (std::size_t i = 0; i < series.size(); ++i) {
    for (std::size_t k = i + 1; k < series.size(); ++k) {
      if (search_s > 0.0 && group[i] == group[k]) continue;
      const auto pair = agreeing_offset(series, i, k, search_s, progress);
      if (!pair) continue;
      pairs.push_back(*pair);
      if (pair->share >= sure_share && pair->num_common >= sure_common)
        std::ranges::replace(group, std::size_t{group[k]}, std::size_t{group[i]});
    }
  }
  return pairs;
}

}  // namespace

void rebuild_path(std::span<const ObservationSeries> series, double knot_s, MovingStart& start) {
  double from_s = 1e300, to_s = -1e300;
  for (std::size_t c = 0; c < series.size(); ++c) {
    if (!start.cameras[c].placed) continue;
    from_s = std::min(from_s, series[c].t_s.front() - start.cameras[c].offset_s);
    to_s = std::max(to_s, series[c].t_s.back() - start.cameras[c].offset_s);
  }
  const double mid_s = 0.5 * (start.t_s.front() + start.t_s.back());
  MovingStart rebuilt;
  // Moments counted from the first observation of the camera that the path's clock is: whatever else is not yet known.
  const double anchor_s = series[start.first].t_s.front();
  for (double k = std::ceil((from_s - anchor_s) / knot_s);; ++k) {
    const double t_s = anchor_s + k * knot_s;
    if (t_s > to_s) break;
    std::vector<SeenRay> rays;
    for (std::size_t c = 0; c < series.size(); ++c) {
      if (!start.cameras[c].placed) continue;
      const auto at = series[c].seen_at(time_of(start.cameras[c], t_s, mid_s));
      if (!at) continue;
      const Rigid3 world_from_cam = start.cameras[c].cam_from_world.inverse();
      rays.push_back({world_from_cam.translation, world_from_cam.rotation * at->homogeneous().normalized(),
                      std::max(5e-3, max_miss_px / series[c].px)});
    }
    const auto point = meeting_point(rays);
    if (!point) continue;
    rebuilt.t_s.push_back(t_s);
    rebuilt.path.push_back(*point);
  }
  if (rebuilt.t_s.size() < 30) return;
  // The rates pivot about the path's midpoint: moved, they must say the same.
  const double moved_s = 0.5 * (rebuilt.t_s.front() + rebuilt.t_s.back()) - mid_s;
  for (MovingStart::Placed& camera : start.cameras) camera.offset_s += (camera.rate - 1.0) * moved_s;
  start.t_s = std::move(rebuilt.t_s);
  start.path = std::move(rebuilt.path);
}

namespace {

/// All cameras, one after the other, from this pair on; none where it has no pose: of a pair with a mirrored camera
/// rays agree, but meet behind one of the two.
std::optional<MovingStart> start_from(const ObservationPair& pair, std::span<const ObservationSeries> series,
                                      const std::vector<ObservationPair>& pairs, double search_s, double knot_s,
                                      const Progress& progress) {
  auto pose = relative_pose(series[pair.first], series[pair.second], pair.offset_s);
  if (!pose) return std::nullopt;
  MovingStart start;
  start.cameras.resize(series.size());
  start.found = true;
  start.first = pair.first;
  start.second = pair.second;
  start.t_s = std::move(pose->t_s);
  start.path = std::move(pose->point_in_first);
  start.cameras[pair.first].placed = start.cameras[pair.second].placed = true;
  start.cameras[pair.second].cam_from_world = pose->cam_from_first;
  start.cameras[pair.second].offset_s = pair.offset_s;
  rebuild_path(series, knot_s, start);
  // By the path of more cameras one may agree that did not before.
  for (std::size_t num_before = 0; num_before != num_placed(start);) {
    num_before = num_placed(start);
    std::vector<bool> tried(series.size(), false);
    while (place_next(series, pairs, search_s > 0.0, tried, start)) {
      report_progress(progress, "cameras", 0, series.size());
      rebuild_path(series, knot_s, start);
    }
  }
  for (MovingStart::Placed& camera : start.cameras)
    if (!camera.placed && camera.reason.empty()) camera.reason = "saw the target at no time when others did";
  return start;
}

}  // namespace

MovingStart start_cameras(std::span<const ObservationSeries> series, double search_s, double knot_s,
                          std::size_t num_better, const Progress& progress) {
  constexpr int max_starts = 4;
  MovingStart best;
  best.cameras.resize(series.size());
  std::vector<ObservationPair> pairs = given_pairs(series, search_s, progress);
  std::vector<ObservationPair> by_strength = pairs;
  std::ranges::sort(by_strength, std::greater{}, start_strength);
  int num_starts = 0;
  for (const ObservationPair& pair : std::span(by_strength).subspan(std::min(num_better, by_strength.size()))) {
    if (pair.share < min_share || num_starts == max_starts || num_placed(best) == series.size()) break;
    auto start = start_from(pair, series, pairs, search_s, knot_s, progress);
    if (!start) continue;
    ++num_starts;
    if (num_placed(*start) > num_placed(best)) best = std::move(*start);
  }
  best.has_common = !pairs.empty();
  return best;
}

}  // namespace alidade
