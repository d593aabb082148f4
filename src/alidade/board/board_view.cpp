#include "alidade/board/board_view.h"

namespace alidade {

std::string corners_fault(const BoardView& view, int num_points) {
  std::vector<bool> seen(static_cast<std::size_t>(num_points < 0 ? 0 : num_points));
  for (const Corner& corner : view.corners) {
    const std::string name = "corner " + std::to_string(corner.index);
    if (corner.index < 0 || corner.index >= num_points)
      return name + ": the board has " + std::to_string(num_points) + " points, numbered from 0";
    if (!corner.px.allFinite()) return name + ": its position is not finite";
    std::vector<bool>::reference is_seen = seen[static_cast<std::size_t>(corner.index)];
    if (is_seen) return name + " appears twice";
    is_seen = true;
  }
  return "";
}

}  // namespace alidade
