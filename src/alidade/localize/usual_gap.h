#pragma once

#include <algorithm>
#include <functional>
#include <queue>
#include <vector>

namespace alidade {

/// Running median of the time between frames: of the gaps so far (of an even number the upper one), by two
/// heaps, so that a frame costs no more the more there were.
class UsualGap {
 public:
  void add(double gap_s) {
    if (upper_.empty() || gap_s >= upper_.top()) {
      upper_.push(gap_s);
    } else {
      lower_.push(gap_s);
    }
    if (lower_.size() > upper_.size()) {
      upper_.push(lower_.top());
      lower_.pop();
    } else if (upper_.size() > lower_.size() + 1) {
      lower_.push(upper_.top());
      upper_.pop();
    }
    // Of an even number both heaps are as large; of an odd one the upper has one more: its top is the median.
  }
  /// 1 where there is none yet.
  [[nodiscard]] double s() const { return upper_.empty() ? 1.0 : std::max(upper_.top(), 1e-9); }

 private:
  std::priority_queue<double> lower_;
  std::priority_queue<double, std::vector<double>, std::greater<>> upper_;
};

}  // namespace alidade
