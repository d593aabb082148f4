#include "alidade/localize/filter/point_episodes.h"

#include <algorithm>

namespace alidade {

void join_episodes(const PointEpisodes& episodes, std::span<const long> solved, std::vector<MapPoint>& map) {
  if (episodes.number_of().empty()) return;
  struct Best {
    std::size_t at = 0;
    bool is_solved = false;
  };
  std::unordered_map<long, Best> best;
  std::vector<MapPoint> joined;
  for (MapPoint point : map) {
    const bool is_solved = std::ranges::binary_search(solved, point.id);
    point.id = episodes.number(point.id);
    const auto [at, is_new] = best.try_emplace(point.id, Best{joined.size(), is_solved});
    if (is_new) {
      joined.push_back(point);
      continue;
    }
    MapPoint& kept = joined[at->second.at];
    const std::size_t num_seen = kept.num_seen + point.num_seen;
    const bool is_better = is_solved != at->second.is_solved ? is_solved : point.cov.trace() < kept.cov.trace();
    if (is_better) kept = point;
    at->second.is_solved = at->second.is_solved || is_solved;
    kept.num_seen = num_seen;
  }
  map = std::move(joined);
}

}  // namespace alidade
