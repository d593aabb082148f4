#include "alidade/turned/burned_in.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <set>
#include <utility>

namespace alidade {
namespace {

constexpr double still_within_px = 1.0, moves_by_px = 4.0, place_px = 2.0;
constexpr std::size_t seen_in = 3, min_cells = 3;

using Cell = std::pair<int, int>;

Cell cell_of(const Eigen::Vector2d& px) {
  return {static_cast<int>(std::floor(px.x() / place_px)), static_cast<int>(std::floor(px.y() / place_px))};
}

/// Calls visit(cell) for the pixel's cell and the eight around it.
template <typename Visit>
void about(const Eigen::Vector2d& px, const Visit& visit) {
  const Cell at = cell_of(px);
  for (int dx = -1; dx <= 1; ++dx) {
    for (int dy = -1; dy <= 1; ++dy) visit(Cell{at.first + dx, at.second + dy});
  }
}

const Eigen::Vector2d& pixel_of(const MatchedPhotos& photos, int photo, int feature) {
  return photos.features[static_cast<std::size_t>(photo)][static_cast<std::size_t>(feature)];
}

/// Cells whose features stay although the homography of their pair moves them, and the photos that show it.
std::map<Cell, std::set<int>> contradicted(const std::vector<PhotoLink>& links, const MatchedPhotos& photos) {
  const PhotoScale scale(photos);
  std::map<Cell, std::set<int>> seen;
  for (const PhotoLink& link : links) {
    for (const FeatureMatch& match : photos.pairs[link.pair].matches) {
      const Eigen::Vector2d& a = pixel_of(photos, link.photo_a, match.a);
      if ((a - pixel_of(photos, link.photo_b, match.b)).norm() > still_within_px) continue;
      const Eigen::Vector3d moved = link.b_from_a * scale.normalised(a).homogeneous();
      const bool is_behind = !(moved.z() > 0.0);
      if (!is_behind && (moved.hnormalized() - scale.normalised(a)).norm() * scale.half_width_px < moves_by_px)
        continue;
      about(a, [&](const Cell& place) { seen[place].insert({link.photo_a, link.photo_b}); });
    }
  }
  return seen;
}

}  // namespace

std::size_t remove_burned_in(const std::vector<PhotoLink>& links, MatchedPhotos& photos) {
  std::map<Cell, std::set<int>> places = contradicted(links, photos);
  std::erase_if(places, [](const auto& place) { return place.second.size() < seen_in; });
  constexpr std::size_t about_each = 9;
  if (places.size() < min_cells * about_each) return 0;
  std::size_t removed = 0;
  for (MatchedPair& pair : photos.pairs) {
    removed += std::erase_if(pair.matches, [&](const FeatureMatch& match) {
      return places.contains(cell_of(pixel_of(photos, pair.photo_a, match.a))) ||
             places.contains(cell_of(pixel_of(photos, pair.photo_b, match.b)));
    });
  }
  return removed;
}

}  // namespace alidade
