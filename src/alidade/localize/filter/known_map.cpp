#include "alidade/localize/filter/known_map.h"

#include <algorithm>
#include <cmath>

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
  const auto centre = sigmas_m.begin() + static_cast<std::ptrdiff_t>(sigmas_m.size() / 2);
  std::ranges::nth_element(sigmas_m, centre);
  constexpr double far_less_sure = 5.0;
  std::erase_if(points, [&](const KnownPoint& point) { return point.sigma_m > far_less_sure * *centre; });
  return points;
}

}  // namespace alidade
