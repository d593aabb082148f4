#pragma once

#include <Eigen/Core>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// The run's clock. A simulated head may provide its own, which runs without waiting.
class HeadClock {
 public:
  virtual ~HeadClock() = default;
  [[nodiscard]] virtual double now_s() const = 0;  ///< Seconds since 1970.
  virtual void wait_until(double t_s) = 0;
  /// It stands still while nobody waits, so that slow callers are never late.
  [[nodiscard]] virtual bool is_free() const { return false; }
};

/// The machine's clock: steady from the first call on, so that setting the clock does not cause a jump in a run.
[[nodiscard]] std::shared_ptr<HeadClock> machine_clock();

/// Pan > 0 turns left, tilt > 0 up. Infinite: the device states no limit.
struct HeadLimits {
  Eigen::Vector2d low_rad = Eigen::Vector2d::Constant(-1e9), high_rad = Eigen::Vector2d::Constant(1e9);
  bool are_given = false;                ///< The device states them.
  std::string info;                      ///< Name of the device, as it reports it.
  std::vector<Assumption> assumed = {};  ///< Assumptions about the conversion of its counts to angles.

  [[nodiscard]] bool hold(const Eigen::Vector2d& pan_tilt_rad) const;
};

/// Position reported by the head, at the midpoint of request and reply.
struct HeadPosition {
  double t_s = 0.0, wait_s = 0.0;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
};

/// Time at which a command was sent, and duration of its reply.
struct HeadSent {
  double t_s = 0.0, wait_s = 0.0;
};

/// A pan-tilt head behind some protocol. Every call ends within its timeout. Throws InputError: no reply, an invalid
/// reply, an angle that is not finite, a command that the head rejects.
class HeadDevice {
 public:
  virtual ~HeadDevice() = default;
  [[nodiscard]] virtual HeadLimits limits() = 0;
  [[nodiscard]] virtual HeadPosition position() = 0;
  /// Never sends a position that is not finite or outside `limits()`: throws InputError instead.
  virtual HeadSent command(const Eigen::Vector2d& pan_tilt_rad) = 0;
  /// Tries to reconnect if the connection is lost.
  virtual HeadSent stop() = 0;
  /// 0 the widest … 1 the narrowest; none: no zoom that can be queried.
  [[nodiscard]] virtual std::optional<double> zoom() { return std::nullopt; }
  virtual void zoom_to(double share);

  /// If pan is periodic over a revolution: selects the revolution nearest to this.
  virtual void count_pan_near(double pan_rad) { (void)pan_rad; }
  /// False: it reports unasked, and its response time is unknown.
  [[nodiscard]] virtual bool answers_questions() const { return true; }

  [[nodiscard]] virtual const std::string& name() const = 0;  ///< Prefix of messages; without a password.
  [[nodiscard]] virtual HeadClock& clock() = 0;
};

struct HeadOptions {
  std::string password;    ///< For the user in the URL; appears in no message.
  double timeout_s = 0.5;  ///< Of every call: a moving head that does not reply within it is stopped.
};

/// The head of a URL: rotctl://HOST:PORT, onvif://USER@HOST, indi://HOST:PORT/DEVICE, sim://?seed=3. Throws InputError:
/// unknown protocol, no reply.
[[nodiscard]] std::unique_ptr<HeadDevice> open_head(const std::string& url, const HeadOptions& options = {});

/// Guards a head that may move: limits its angles and the rate of requests, and stops it on destruction in any case.
class MovingHead {
 public:
  /// `low`, `high`: limits set by the user, within those of the device.
  MovingHead(HeadDevice& device, const Eigen::Vector2d& low_rad, const Eigen::Vector2d& high_rad, Progress progress);
  /// Stops the head.
  ~MovingHead();
  MovingHead(const MovingHead&) = delete;
  MovingHead& operator=(const MovingHead&) = delete;

  [[nodiscard]] HeadPosition position();
  /// Throws InputError, and sends nothing, if the head rests outside the limits: its way back could be long.
  HeadSent command(const Eigen::Vector2d& pan_tilt_rad);
  /// The same without a pause after the previous request: the pause follows later.
  HeadSent command_at_once(const Eigen::Vector2d& pan_tilt_rad);
  void zoom_to(double share);
  /// Stops the head; throws InputError if that fails.
  void stop();
  /// Waits until then. Throws Interrupted after Ctrl-C.
  void wait_until(double t_s);

  [[nodiscard]] double now_s() { return device_.clock().now_s(); }
  [[nodiscard]] const Eigen::Vector2d& low_rad() const { return low_; }
  [[nodiscard]] const Eigen::Vector2d& high_rad() const { return high_; }
  [[nodiscard]] HeadDevice& device() { return device_; }
  /// Called with each reading and each command that was sent.
  std::function<void(const HeadPosition&)> on_reading;
  std::function<void(const HeadSent&, const Eigen::Vector2d&)> on_command;

 private:
  void keep_pace();
  HeadSent send(const Eigen::Vector2d& pan_tilt_rad);
  void heed_interrupt();
  void heed_limits(const HeadPosition& reading);
  void heed_start();

  HeadDevice& device_;
  Eigen::Vector2d low_, high_;
  Eigen::Vector2d reach_low_ = Eigen::Vector2d::Constant(-1e9), reach_high_ = Eigen::Vector2d::Constant(1e9);
  Progress progress_;
  std::optional<Eigen::Vector2d> rests_at_;  ///< Position before it moved.
  double next_question_s_ = 0.0;
  bool has_moved_ = false;
};

}  // namespace alidade
