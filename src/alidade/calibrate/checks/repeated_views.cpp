#include "alidade/calibrate/checks/repeated_views.h"

#include <algorithm>
#include <map>
#include <utility>

namespace alidade {
namespace {

bool same_corners(const BoardView& a, const BoardView& b) {
  return std::equal(a.corners.begin(), a.corners.end(), b.corners.begin(), b.corners.end(),
                    [](const Corner& p, const Corner& q) { return p.index == q.index && p.px == q.px; });
}

}  // namespace

std::vector<std::optional<std::size_t>> repeated_views(std::span<const BoardView> views) {
  std::vector<std::optional<std::size_t>> repeats(views.size());
  std::multimap<std::pair<double, double>, std::size_t> seen;  // by the first corner
  for (std::size_t k = 0; k < views.size(); ++k) {
    if (views[k].corners.empty()) continue;
    const Eigen::Vector2d& px = views[k].corners.front().px;
    const auto [begin, end] = seen.equal_range({px.x(), px.y()});
    for (auto each = begin; each != end && !repeats[k]; ++each) {
      if (same_corners(views[each->second], views[k])) repeats[k] = each->second;
    }
    if (!repeats[k]) seen.emplace(std::pair(px.x(), px.y()), k);
  }
  return repeats;
}

}  // namespace alidade
