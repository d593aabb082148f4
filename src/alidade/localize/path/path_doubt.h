#pragma once

#include <cstddef>
#include <deque>

#include "alidade/localize/localization.h"

namespace alidade {

enum class Doubt {
  none,
  some,    ///< More than three in ten of the target's observations are gated: the path may be wrong, or they are.
  many,    ///< Most observations, or nearly all of the target's, are gated.
  strong,  ///< The observations that fit contradict each other: the path is wrong.
};

/// `part` / `of`; 0 if `of` is 0.
[[nodiscard]] double share(std::size_t part, std::size_t of);

/// Whether the last frames indicate that the path is wrong: it may be consistent with its own map and still be wrong.
class PathDoubt {
 public:
  /// Updated with one step; over the last five frames with observations. Strong: mean NIS above 2.
  [[nodiscard]] Doubt after(const PathStep& step);
  void clear();

 private:
  std::deque<double> recent_nis_, recent_gated_, recent_known_gated_;
};

}  // namespace alidade
