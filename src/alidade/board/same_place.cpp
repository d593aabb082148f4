#include "alidade/board/same_place.h"

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

bool at_one_place(const BoardView& a, const BoardView& b, double near_px) {
  std::map<int, Eigen::Vector2d> of_a;
  for (const Corner& corner : a.corners) of_a.emplace(corner.index, corner.px);
  std::size_t common = 0;
  for (const Corner& corner : b.corners) {
    const auto same = of_a.find(corner.index);
    if (same == of_a.end()) continue;
    if (!((corner.px - same->second).squaredNorm() <= near_px * near_px)) return false;
    ++common;
  }
  return common > 0 && 5 * common >= 4 * std::max(a.corners.size(), b.corners.size());
}

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

std::vector<Corner> mean_corners(std::span<const BoardView> views) {
  if (views.empty()) return {};
  std::map<int, std::vector<Eigen::Vector2d>> seen;
  for (const BoardView& view : views)
    for (const Corner& corner : view.corners) seen[corner.index].push_back(corner.px);
  std::vector<Corner> corners = views.front().corners;
  for (Corner& corner : corners) {
    Eigen::Vector2d sum = Eigen::Vector2d::Zero();
    for (const Eigen::Vector2d& px : seen[corner.index]) sum += px;
    corner.px = sum / static_cast<double>(seen[corner.index].size());
  }
  return corners;
}

}  // namespace alidade
