#pragma once

#include <deque>

namespace alidade::live {

/// Passes at most a number of messages per second, evenly spaced if there are more: in no second more than `max_hz`.
/// Time is an argument and must not decrease.
class RateLimit {
 public:
  explicit RateLimit(double max_hz) : max_hz_(max_hz) {}

  [[nodiscard]] bool lets_through(double now_s) {
    while (!passed_s_.empty() && now_s - passed_s_.front() >= 1.0) passed_s_.pop_front();
    // A few may follow closely, as what comes at the rate itself does not come evenly.
    constexpr double max_saved = 6.0;
    if (has_last_) saved_ += (now_s - last_s_) * max_hz_;
    if (saved_ > max_saved) saved_ = max_saved;
    last_s_ = now_s;
    has_last_ = true;
    if (saved_ < 1.0 || static_cast<double>(passed_s_.size()) >= max_hz_) return false;
    saved_ -= 1.0;
    passed_s_.push_back(now_s);
    return true;
  }

 private:
  double max_hz_, saved_ = 6.0, last_s_ = 0.0;
  bool has_last_ = false;
  std::deque<double> passed_s_;
};

}  // namespace alidade::live
