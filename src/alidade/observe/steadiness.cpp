#include "alidade/observe/steadiness.h"

#include <algorithm>

namespace alidade {

Steadiness steadiness_of(const RotationBundle& bundle, const BundleSolution& solution) {
  struct Sums {
    double along = 0.0, length = 0.0, squares = 0.0;
    int num = 0;
  };
  std::vector<Sums> frames(bundle.frames.size());
  const Eigen::Vector2d centre = solution.camera.k.tail<2>();
  for (std::size_t i = 0; i < bundle.observations.size(); ++i) {
    const BundleObservation& seen = bundle.observations[i];
    const Eigen::Vector2d& residual = solution.residuals[i];
    if (!residual.allFinite()) continue;
    Sums& sums = frames[static_cast<std::size_t>(seen.frame)];
    const Eigen::Vector2d direction = seen.px - centre;
    sums.along += residual.dot(direction);
    sums.length += direction.squaredNorm();
    sums.squares += residual.squaredNorm();
    ++sums.num;
  }
  double explained = 0.0, all = 0.0;
  int num_frames = 0;
  for (const Sums& sums : frames) {
    all += sums.squares;
    if (sums.num < 2 || !(sums.length > 0.0)) continue;
    explained += sums.along * sums.along / sums.length;
    ++num_frames;
  }
  const int left = solution.dof - num_frames;
  if (num_frames < 5 || left < 5 || !(all > explained)) return {};
  return {explained / all, (explained / num_frames) / std::max((all - explained) / left, 1e-30)};
}

}  // namespace alidade
