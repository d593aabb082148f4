#include "alidade/board/same_place.h"

#include <algorithm>
#include <map>

namespace alidade {

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
