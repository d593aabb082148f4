#include "alidade/heads/head_device.h"

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <thread>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/heads/protocols/indi_head.h"
#include "alidade/heads/protocols/line_socket.h"
#include "alidade/heads/protocols/onvif_head.h"
#include "alidade/heads/protocols/rotctl_head.h"
#include "alidade/heads/simulated_head.h"

namespace alidade {
namespace {

class MachineClock final : public HeadClock {
 public:
  MachineClock() { look_at_both(); }
  [[nodiscard]] double now_s() const override {
    return begin_s_ + std::chrono::duration<double>(std::chrono::steady_clock::now() - begin_).count();
  }
  void wait_until(double t_s) override {
    const double left = t_s - now_s();
    if (left > 0.0) std::this_thread::sleep_for(std::chrono::duration<double>(left));
  }

 private:
  using Steady = std::chrono::steady_clock;
  /// Both clocks at once: of a few tries the one in which the least time went by between them.
  void look_at_both() {
    constexpr int tries = 50;
    auto least = Steady::duration::max();
    for (int i = 0; i < tries; ++i) {
      const Steady::time_point before = Steady::now();
      const double unix_s = std::chrono::duration<double>(std::chrono::system_clock::now().time_since_epoch()).count();
      const Steady::duration between = Steady::now() - before;
      if (between >= least) continue;
      least = between;
      begin_ = before + between / 2;
      begin_s_ = unix_s;
    }
  }

  Steady::time_point begin_;
  double begin_s_ = 0.0;
};

constexpr double margin_rad = 2.0 * degree;  // beyond the limits, where it came to rest or rounds its readings

/// Questions and commands a second, all together: what asks more often changes what it asks about.
constexpr double max_calls_hz = 40.0;

}  // namespace

std::shared_ptr<HeadClock> machine_clock() {
  static const auto clock = std::make_shared<MachineClock>();
  return clock;
}

bool HeadLimits::hold(const Eigen::Vector2d& at) const {
  constexpr double rounding_rad = 1e-9;
  return at.allFinite() && (at.array() >= low_rad.array() - rounding_rad).all() &&
         (at.array() <= high_rad.array() + rounding_rad).all();
}

std::unique_ptr<HeadDevice> open_head(const std::string& url, const HeadOptions& options) {
  if (url.starts_with("rotctl://")) return open_rotctl(url, options);
  if (url.starts_with("onvif://")) return open_onvif(url, options);
  if (url.starts_with("indi://")) return open_indi(url, options);
  if (url.starts_with("sim://")) return open_simulated_head(url);
  throw InputError(
      "'" + without_password(url) +
      "' is not a head's address: give rotctl://HOST:PORT, onvif://USER@HOST, indi://HOST:PORT/DEVICE or sim://");
}

void HeadDevice::zoom_to(double) { throw InputError(name() + ": has no zoom that can be commanded"); }

MovingHead::MovingHead(HeadDevice& device, const Eigen::Vector2d& low_rad, const Eigen::Vector2d& high_rad,
                       Progress progress)
    : device_(device), low_(low_rad), high_(high_rad), progress_(std::move(progress)) {
  const HeadLimits limits = device.limits();
  low_ = low_.cwiseMax(limits.low_rad);
  high_ = high_.cwiseMin(limits.high_rad);
  for (int axis = 0; axis < 2; ++axis)
    if (!(low_[axis] <= high_[axis]))
      throw InputError(fmt::format("{}: no {} is within both the head's limits and those that were given",
                                   device.name(), axis == 0 ? "pan" : "tilt"));
  constexpr double no_limit_rad = 1e4;
  if (high_[0] - low_[0] < no_limit_rad) device.count_pan_near(0.5 * (low_[0] + high_[0]));
}

MovingHead::~MovingHead() {
  if (!has_moved_) return;
  try {
    device_.stop();
  } catch (const InputError&) {  // what ended the run is said by who ended it
  }
}

void MovingHead::heed_interrupt() {
  try {
    report_progress(progress_, "moving", 0, 0);
  } catch (const Interrupted&) {
    if (std::exchange(has_moved_, false)) device_.stop();
    throw;
  }
}

/// It began where it was; from there it may go nowhere that it was not sent.
void MovingHead::heed_limits(const HeadPosition& reading) {
  if (!has_moved_) {
    rests_at_ = reading.pan_tilt_rad;
    reach_low_ = low_.cwiseMin(reading.pan_tilt_rad).array() - margin_rad;
    reach_high_ = high_.cwiseMax(reading.pan_tilt_rad).array() + margin_rad;
    return;
  }
  if (HeadLimits{reach_low_, reach_high_, true, ""}.hold(reading.pan_tilt_rad)) return;
  stop();
  throw InputError(fmt::format("{}: has gone to pan {:.3f}°, tilt {:.3f}°, beyond its limits; stopped", device_.name(),
                               reading.pan_tilt_rad[0] / degree, reading.pan_tilt_rad[1] / degree));
}

/// From far outside the way in is as long as the head is far: nobody expects that of a first move.
void MovingHead::heed_start() {
  if (has_moved_) return;
  if (!rests_at_) rests_at_ = device_.position().pan_tilt_rad;
  for (int axis = 0; axis < 2; ++axis) {
    const double at = (*rests_at_)[axis];
    if (at > low_[axis] - margin_rad && at < high_[axis] + margin_rad) continue;
    const char* const name = axis == 0 ? "pan" : "tilt";
    throw InputError(fmt::format(
        "{}: stands at {} {:.3f}°, outside of {:g}…{:g}°; nothing was moved: bring it there by other means, "
        "or give a --{}-range that has it",
        device_.name(), name, at / degree, low_[axis] / degree, high_[axis] / degree, name));
  }
}

void MovingHead::keep_pace() {
  wait_until(next_question_s_);
  next_question_s_ = now_s() + 1.0 / max_calls_hz;
}

HeadPosition MovingHead::position() {
  keep_pace();
  const HeadPosition reading = device_.position();
  heed_limits(reading);
  if (on_reading) on_reading(reading);
  return reading;
}

HeadSent MovingHead::command(const Eigen::Vector2d& pan_tilt_rad) {
  keep_pace();
  return send(pan_tilt_rad);
}

HeadSent MovingHead::command_at_once(const Eigen::Vector2d& pan_tilt_rad) {
  next_question_s_ = std::max(next_question_s_, now_s()) + 1.0 / max_calls_hz;
  return send(pan_tilt_rad);
}

HeadSent MovingHead::send(const Eigen::Vector2d& pan_tilt_rad) {
  heed_interrupt();
  if (!HeadLimits{low_, high_, true, ""}.hold(pan_tilt_rad))
    throw InputError(fmt::format("{}: pan {:.3f}°, tilt {:.3f}° is outside the limits; not sent", device_.name(),
                                 pan_tilt_rad[0] / degree, pan_tilt_rad[1] / degree));
  heed_start();
  has_moved_ = true;
  const HeadSent sent = device_.command(pan_tilt_rad);
  next_question_s_ += 1.0 / max_calls_hz;  // a command asks before
  if (on_command) on_command(sent, pan_tilt_rad);
  return sent;
}

void MovingHead::zoom_to(double share) {
  heed_interrupt();
  keep_pace();
  has_moved_ = true;
  device_.zoom_to(std::clamp(share, 0.0, 1.0));
}

void MovingHead::stop() {
  if (!has_moved_) return;
  device_.stop();
  has_moved_ = false;
  rests_at_.reset();
}

void MovingHead::wait_until(double t_s) {
  constexpr double patience_s = 0.02;
  heed_interrupt();
  while (now_s() < t_s) {
    device_.clock().wait_until(std::min(t_s, now_s() + patience_s));
    heed_interrupt();
  }
}

}  // namespace alidade
