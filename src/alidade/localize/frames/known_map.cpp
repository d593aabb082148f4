#include "alidade/localize/frames/known_map.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

std::vector<KnownPoint> known_points(const SavedMap& map) {
  std::vector<KnownPoint> points;
  std::vector<double> sigmas_m;
  for (const SavedPoint& point : map.points) {
    const double sigma_m = std::sqrt(std::max(symmetric_eigen3(point.cov).values[2], 0.0));
    if (!(sigma_m > 0.0)) continue;
    points.push_back({point.id, point.point_in_world, sigma_m});
    sigmas_m.push_back(sigma_m);
  }
  if (points.empty()) return points;
  constexpr double max_over_median = 5.0;
  const double max_sigma_m = max_over_median * median_of(std::move(sigmas_m));
  std::erase_if(points, [&](const KnownPoint& point) { return point.sigma_m > max_sigma_m; });
  return points;
}

}  // namespace alidade
