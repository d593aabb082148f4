#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/localize/filter/filter_bank.h"

namespace alidade {

/// Poses from a few known points that contradict the path. If some observations are mismatched, a pose fits by chance,
/// and the next such pose is a different one. If the path is wrong, they all give the same correction of it.
class RepeatedPlaces {
 public:
  /// Adds poses, with the path's pose in this frame. Returns how many of the recent frames gave the same correction (χ²
  /// of six components, 99.9 %, assuming that the path between them is accurate to a tenth of its length).
  std::size_t add(std::span<const StartHypothesis> places, const Rigid3& path, std::size_t frame);
  void clear() { said_.clear(); }

 private:
  struct Said {
    std::vector<StartHypothesis> places;
    Rigid3 path;
    std::size_t frame = 0;
  };
  std::vector<Said> said_;
};

}  // namespace alidade
