#include <set>

#include "alidade/localize/path/whole_path.h"

namespace alidade {

std::size_t num_untied(std::span<const PlacedResidual> residuals, std::size_t first_frame,
                       std::span<const PathStep> path) {
  constexpr std::size_t near = 15, enough = 8;
  std::size_t num = 0;
  for (std::size_t k = first_frame; k < path.size(); ++k) {
    if (path[k].event != FrameEvent::restarted) continue;
    std::set<long> before, both;
    for (const PlacedResidual& residual : residuals) {
      const std::size_t at = first_frame + residual.frame;
      if (at + near >= k && at < k) before.insert(residual.id);
      if (at >= k && at <= k + near && before.contains(residual.id)) both.insert(residual.id);
    }
    num += both.size() < enough ? 1 : 0;
  }
  return num;
}

}  // namespace alidade
