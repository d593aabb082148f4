#include "alidade/board/board_view.h"

namespace alidade {
namespace {

std::string corner_fault(const Corner& corner, int num_points) {
  if (corner.index < 0 || corner.index >= num_points)
    return "the board has " + std::to_string(num_points) + " points, numbered from 0";
  const bool is_finite = corner.px.allFinite() && corner.cov.allFinite();
  const bool is_covariance = is_finite && corner.cov(0, 0) > 0.0 && corner.cov.determinant() > 0.0;
  return is_covariance ? "" : "its position must be finite, and its covariance positive definite";
}

}  // namespace

std::string corners_fault(const BoardView& view, int num_points) {
  std::vector<bool> seen(static_cast<std::size_t>(num_points < 0 ? 0 : num_points));
  for (const Corner& corner : view.corners) {
    const std::string name = view.photo + ": corner " + std::to_string(corner.index);
    if (const std::string what = corner_fault(corner, num_points); !what.empty()) return name + ": " + what;
    std::vector<bool>::reference is_seen = seen[static_cast<std::size_t>(corner.index)];
    if (is_seen) return name + " appears twice";
    is_seen = true;
  }
  return "";
}

}  // namespace alidade
