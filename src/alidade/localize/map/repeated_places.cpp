#include "alidade/localize/map/repeated_places.h"

#include <algorithm>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

constexpr std::size_t max_age = 60;  // frames; after that the path itself has drifted

/// Whether `there` equals `before`, propagated along the path from `from` to `to`.
bool is_same(const StartHypothesis& there, const StartHypothesis& before, const Rigid3& from, const Rigid3& to) {
  constexpr double max_chi2 = 22.5, path_error = 0.1;
  const Rigid3 expected = before.motion.world_from_cam * from.inverse() * to;
  const Eigen::Vector<double, 6> moved = path_error * pose_difference(to, from);
  Eigen::Matrix<double, 6, 6> cov = there.cov.topLeftCorner<6, 6>() + before.cov.topLeftCorner<6, 6>();
  cov.diagonal().head<3>().array() += moved.head<3>().squaredNorm();
  cov.diagonal().tail<3>().array() += moved.tail<3>().squaredNorm();
  return squared_mahalanobis(pose_difference(there.motion.world_from_cam, expected), cov) < max_chi2;
}

}  // namespace

std::size_t RepeatedPlaces::add(std::span<const StartHypothesis> places, const Rigid3& path, std::size_t frame) {
  std::erase_if(said_, [&](const Said& said) { return said.frame == frame || said.frame + max_age < frame; });
  const auto num = std::ranges::count_if(said_, [&](const Said& said) {
    return std::ranges::any_of(places, [&](const StartHypothesis& there) {
      return std::ranges::any_of(
          said.places, [&](const StartHypothesis& before) { return is_same(there, before, said.path, path); });
    });
  });
  said_.push_back({{places.begin(), places.end()}, path, frame});
  return static_cast<std::size_t>(num);
}

}  // namespace alidade
