#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/localize/filter/filter_bank.h"

namespace alidade {

/// Poses from a few known points that contradict the path. Where some of them show another point, a pose fits them by
/// chance; the next such pose is then another one. Where the path is wrong, they say the same correction of it.
class RepeatedPlaces {
 public:
  /// Keeps them, with the path's pose in this frame. How many of the last frames before it said the same (χ² of six
  /// components, 99.9 %, where the path between them is good to a tenth of its length).
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
