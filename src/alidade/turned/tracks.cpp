#include "alidade/turned/tracks.h"

#include <algorithm>
#include <cmath>
#include <map>

namespace alidade {
namespace {

using Node = std::pair<int, int>;  // photo, feature

/// Disjoint sets of features that belong to one point, at most one per photo.
class FeatureSets {
 public:
  bool join(const Node& a, const Node& b) {
    std::size_t set_a = set_of(a), set_b = set_of(b);
    if (set_a == set_b) return true;
    if (members_[set_a].size() < members_[set_b].size()) std::swap(set_a, set_b);
    const auto is_in_a = [&](const Node& node) {
      return std::ranges::any_of(members_[set_a], [&](const Node& other) { return other.first == node.first; });
    };
    if (std::ranges::any_of(members_[set_b], is_in_a)) return false;
    for (const Node& node : members_[set_b]) {
      place_[node] = set_a;
      members_[set_a].push_back(node);
    }
    members_[set_b].clear();
    return true;
  }
  [[nodiscard]] const std::vector<std::vector<Node>>& sets() const { return members_; }

 private:
  std::size_t set_of(const Node& node) {
    const auto [it, is_new] = place_.try_emplace(node, members_.size());
    if (is_new) members_.push_back({node});
    return it->second;
  }

  std::map<Node, std::size_t> place_;
  std::vector<std::vector<Node>> members_;
};

/// Mean direction of a point from the observations [first, last); zero if one of them has no ray.
Eigen::Vector3d mean_ray(const TurnedBundle& bundle, std::size_t first, std::size_t last) {
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (std::size_t i = first; i < last; ++i) {
    const auto photo = static_cast<std::size_t>(bundle.observations[i].photo);
    const auto ray = turned_ray(bundle.camera, bundle.log_zoom[photo], bundle.observations[i].px);
    if (!ray) return Eigen::Vector3d::Zero();
    sum += bundle.cam_from_world[photo].transpose() * *ray;
  }
  return sum.norm() > 0.0 ? Eigen::Vector3d(sum.normalized()) : sum;
}

}  // namespace

std::vector<KeptMatch> agreeing_matches(const std::vector<PhotoLink>& links) {
  std::vector<const PhotoLink*> order;
  for (const PhotoLink& link : links) order.push_back(&link);
  std::stable_sort(order.begin(), order.end(),
                   [](const PhotoLink* a, const PhotoLink* b) { return a->inliers.size() > b->inliers.size(); });
  std::vector<KeptMatch> kept;
  for (const PhotoLink* link : order) {
    for (const int match : link->inliers) kept.push_back({link->pair, match});
  }
  return kept;
}

std::vector<KeptMatch> explained_matches(const MatchedPhotos& photos, const TurnedBundle& bundle,
                                         const std::vector<int>& bundle_place, double gate) {
  const PhotoScale scale(photos);
  std::vector<KeptMatch> kept;
  for (std::size_t p = 0; p < photos.pairs.size(); ++p) {
    const MatchedPair& pair = photos.pairs[p];
    const int at_a = bundle_place[static_cast<std::size_t>(pair.photo_a)];
    const int at_b = bundle_place[static_cast<std::size_t>(pair.photo_b)];
    if (at_a < 0 || at_b < 0) continue;
    const auto a = static_cast<std::size_t>(at_a), b = static_cast<std::size_t>(at_b);
    const Eigen::Matrix3d b_from_a = turn_between(bundle, a, b);
    for (std::size_t m = 0; m < pair.matches.size(); ++m) {
      const auto px = [&](int photo, int feature) {
        return scale.normalised(photos.features[static_cast<std::size_t>(photo)][static_cast<std::size_t>(feature)]);
      };
      const auto ray = turned_ray(bundle.camera, bundle.log_zoom[a], px(pair.photo_a, pair.matches[m].a));
      if (!ray) continue;
      const auto seen = turned_pixel(bundle.camera, b_from_a, bundle.log_zoom[b], *ray);
      if (seen && (*seen - px(pair.photo_b, pair.matches[m].b)).norm() < gate) kept.push_back({p, static_cast<int>(m)});
    }
  }
  return kept;
}

std::size_t set_tracks(const MatchedPhotos& photos, const std::vector<KeptMatch>& matches,
                       const std::vector<int>& bundle_place, TurnedBundle& bundle) {
  const PhotoScale scale(photos);
  FeatureSets sets;
  std::size_t joined = 0;
  for (const KeptMatch& kept : matches) {
    const MatchedPair& pair = photos.pairs[kept.pair];
    const int a = bundle_place[static_cast<std::size_t>(pair.photo_a)];
    const int b = bundle_place[static_cast<std::size_t>(pair.photo_b)];
    if (a < 0 || b < 0) continue;
    const FeatureMatch& match = pair.matches[static_cast<std::size_t>(kept.match)];
    joined += sets.join({pair.photo_a, match.a}, {pair.photo_b, match.b}) ? 1u : 0u;
  }
  bundle.observations.clear();
  bundle.rays.clear();
  for (const auto& set : sets.sets()) {
    if (set.size() < 2) continue;
    const std::size_t first = bundle.observations.size();
    for (const auto& [photo, feature] : set) {
      const Eigen::Vector2d& px = photos.features[static_cast<std::size_t>(photo)][static_cast<std::size_t>(feature)];
      bundle.observations.push_back(
          {bundle_place[static_cast<std::size_t>(photo)], static_cast<int>(bundle.rays.size()), scale.normalised(px)});
    }
    const Eigen::Vector3d ray = mean_ray(bundle, first, bundle.observations.size());
    if (ray.norm() > 0.0) {
      bundle.rays.push_back(ray);
    } else {
      bundle.observations.resize(first);
    }
  }
  return joined;
}

std::size_t leave_out(const std::vector<Eigen::Vector2d>& residuals, double gate, TurnedBundle& bundle) {
  const std::vector<double> norms = freed_norms(bundle, residuals);
  TurnedBundle kept = bundle;
  kept.observations.clear();
  kept.rays.clear();
  for (std::size_t i = 0; i < bundle.observations.size();) {
    std::size_t end = i, worst = i;
    for (; end < bundle.observations.size() && bundle.observations[end].track == bundle.observations[i].track; ++end) {
      if (!(norms[end] <= norms[worst])) worst = end;
    }
    const bool is_out = !(norms[worst] <= gate);
    if (end - i - (is_out ? 1u : 0u) >= 2) {
      for (std::size_t j = i; j < end; ++j) {
        if (is_out && j == worst) continue;
        kept.observations.push_back(bundle.observations[j]);
        kept.observations.back().track = static_cast<int>(kept.rays.size());
      }
      kept.rays.push_back(bundle.rays[static_cast<std::size_t>(bundle.observations[i].track)]);
    }
    i = end;
  }
  const std::size_t out = bundle.observations.size() - kept.observations.size();
  bundle = std::move(kept);
  return out;
}

}  // namespace alidade
