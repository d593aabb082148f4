#pragma once

#include <chrono>
#include <cstddef>

namespace alidade::cli {

/// Holds a run to the wall clock: its steps come when they would come, or so many times as fast.
class Pace {
 public:
  explicit Pace(double times) : times_(times) {}

  /// Waits until the step of this time is due, and counts it as late where that is past. A time half a second before
  /// the last one begins again. Throws Interrupted after Ctrl-C.
  void keep(double t_s);

  [[nodiscard]] std::size_t num_steps() const { return num_steps_; }
  [[nodiscard]] std::size_t num_late() const { return num_late_; }  ///< By more than a millisecond.
  [[nodiscard]] double worst_late_s() const { return worst_late_s_; }

 private:
  double times_, first_s_ = 0.0, last_s_ = 0.0, worst_late_s_ = 0.0;
  bool has_begun_ = false;
  std::size_t num_steps_ = 0, num_late_ = 0;
  std::chrono::steady_clock::time_point begin_;
};

}  // namespace alidade::cli
