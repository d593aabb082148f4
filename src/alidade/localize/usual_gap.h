#pragma once

#include <algorithm>
#include <functional>
#include <queue>
#include <vector>

namespace alidade {

/// Running median of the time between frames, over all gaps so far (the upper one of an even number), with two heaps:
/// the cost per frame does not grow with their number.
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
    // With an even number both heaps have the same size; with an odd one the upper has one more: its top is the median.
  }
  /// 1 if there is none yet.
  [[nodiscard]] double s() const { return upper_.empty() ? 1.0 : std::max(upper_.top(), 1e-9); }

 private:
  std::priority_queue<double> lower_;
  std::priority_queue<double, std::vector<double>, std::greater<>> upper_;
};

}  // namespace alidade
