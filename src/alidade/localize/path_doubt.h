#pragma once

#include <deque>

#include "alidade/localize/localize.h"

namespace alidade {

/// Whether the last frames say that the path is wrong: a path may fit its own map well and be elsewhere.
class PathDoubt {
 public:
  /// Mean NIS above 2, or most sights or most of the target's gated, over five frames with sights.
  [[nodiscard]] bool is_wrong_after(const PathStep& step);
  void clear();

 private:
  std::deque<double> recent_nis_, recent_gated_;
};

}  // namespace alidade
