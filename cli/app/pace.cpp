#include "cli/app/pace.h"

#include <algorithm>
#include <cmath>
#include <thread>

#include "cli/app/terminal.h"

namespace alidade::cli {

void Pace::keep(double t_s) {
  if (!(times_ > 0.0) || !std::isfinite(t_s)) return;
  using Clock = std::chrono::steady_clock;
  if (!has_begun_ || t_s < last_s_ - 0.5) {
    has_begun_ = true;
    begin_ = Clock::now();
    first_s_ = last_s_ = t_s;
  }
  last_s_ = std::max(t_s, last_s_);
  const auto due =
      begin_ + std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>((t_s - first_s_) / times_));
  ++num_steps_;
  constexpr double tolerated_s = 1e-3;
  const double late_s = std::chrono::duration<double>(Clock::now() - due).count();
  worst_late_s_ = std::max(worst_late_s_, late_s);
  if (late_s > tolerated_s) ++num_late_;
  while (Clock::now() < due) {
    if (interrupting_signal() != 0) throw Interrupted();
    std::this_thread::sleep_until(std::min(due, Clock::now() + std::chrono::milliseconds(50)));
  }
}

}  // namespace alidade::cli
