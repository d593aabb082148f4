#pragma once

#include "alidade/turned/photo_links.h"
#include "alidade/turned/turned_bundle.h"

namespace alidade {

/// An accepted match.
struct KeptMatch {
  std::size_t pair = 0;
  int match = 0;
};

/// The matches that agree with each link's homography, strongest link first.
[[nodiscard]] std::vector<KeptMatch> agreeing_matches(const std::vector<PhotoLink>& links);

/// The matches between the bundle's photos that its camera and rotations explain within `gate` (normalised), by
/// transfer from one photo to the other. `bundle_place[photo]`: −1 for photos that are not used.
[[nodiscard]] std::vector<KeptMatch> explained_matches(const MatchedPhotos& photos, const TurnedBundle& bundle,
                                                       const std::vector<int>& bundle_place, double gate);

/// Joins matches to tracks and gives the bundle their observations and rays. A match that would put a point at two
/// positions of one photo is rejected. Returns the number of matches that take part.
std::size_t set_tracks(const MatchedPhotos& photos, const std::vector<KeptMatch>& matches,
                       const std::vector<int>& bundle_place, TurnedBundle& bundle);

/// Rejects observations whose freed_norms() exceeds `gate` (normalised), one per track at a time, the worst first, and
/// tracks observed in fewer than two photos. Returns the number of rejected observations.
std::size_t leave_out(const std::vector<Eigen::Vector2d>& residuals, double gate, TurnedBundle& bundle);

}  // namespace alidade
