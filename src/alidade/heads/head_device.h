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

/// Time as the run sees it. A simulated head may bring one of its own, which costs nothing.
class HeadClock {
 public:
  virtual ~HeadClock() = default;
  [[nodiscard]] virtual double now_s() const = 0;  ///< Seconds since 1970.
  virtual void wait_until(double t_s) = 0;
  /// It stands while nobody waits: who is slow is never late.
  [[nodiscard]] virtual bool is_free() const { return false; }
};

/// The machine's: steady from the first call on, so that a clock that is set does not jump in a run.
[[nodiscard]] std::shared_ptr<HeadClock> machine_clock();

/// Pan > 0 turns left, tilt > 0 up. Infinite: the device names no limit.
struct HeadLimits {
  Eigen::Vector2d low_rad = Eigen::Vector2d::Constant(-1e9), high_rad = Eigen::Vector2d::Constant(1e9);
  bool are_given = false;                ///< By the device.
  std::string info;                      ///< What it calls itself.
  std::vector<Assumption> assumed = {};  ///< What nobody gave: by it counts become angles.

  [[nodiscard]] bool hold(const Eigen::Vector2d& pan_tilt_rad) const;
};

/// Where the head says that it is. The time is the midpoint of question and answer.
struct HeadPosition {
  double t_s = 0.0, wait_s = 0.0;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
};

/// When a command was sent, and how long its answer took.
struct HeadSent {
  double t_s = 0.0, wait_s = 0.0;
};

/// A pan-tilt head behind some protocol. Every call ends within its timeout. Throws InputError: no answer, an answer
/// that is none, an angle that is not finite, a command that the head refuses.
class HeadDevice {
 public:
  virtual ~HeadDevice() = default;
  [[nodiscard]] virtual HeadLimits limits() = 0;
  [[nodiscard]] virtual HeadPosition position() = 0;
  /// Never sends what is not finite or outside `limits()`: throws InputError instead.
  virtual HeadSent command(const Eigen::Vector2d& pan_tilt_rad) = 0;
  /// Tries a new connection where the old one is gone.
  virtual HeadSent stop() = 0;
  /// 0 the widest … 1 the narrowest; none: no zoom that can be asked.
  [[nodiscard]] virtual std::optional<double> zoom() { return std::nullopt; }
  virtual void zoom_to(double share);

  /// Where a turn more or less is the same pan: counts it as what is nearest to this.
  virtual void count_pan_near(double pan_rad) { (void)pan_rad; }
  /// False: it reports unasked, and nothing can be said of how long it takes to answer.
  [[nodiscard]] virtual bool answers_questions() const { return true; }

  [[nodiscard]] virtual const std::string& name() const = 0;  ///< To begin a message with; without a password.
  [[nodiscard]] virtual HeadClock& clock() = 0;
};

struct HeadOptions {
  std::string password;    ///< For who is named in the URL; appears in no message.
  double timeout_s = 0.5;  ///< Of every call: a head that moves and says nothing is stopped after it.
};

/// The head of a URL: rotctl://HOST:PORT, onvif://USER@HOST, indi://HOST:PORT/DEVICE, sim://?seed=3. Throws InputError:
/// no such protocol, nobody answers.
[[nodiscard]] std::unique_ptr<HeadDevice> open_head(const std::string& url, const HeadOptions& options = {});

/// Holds a head that may move: within angles, asked not too often, and stopped when this ends, whatever ended it.
class MovingHead {
 public:
  /// `low`, `high`: what the person allows, within what the device does.
  MovingHead(HeadDevice& device, const Eigen::Vector2d& low_rad, const Eigen::Vector2d& high_rad, Progress progress);
  /// Stops the head.
  ~MovingHead();
  MovingHead(const MovingHead&) = delete;
  MovingHead& operator=(const MovingHead&) = delete;

  [[nodiscard]] HeadPosition position();
  /// Throws InputError, and sends nothing, where the head rests outside of the limits: its way there could be long.
  HeadSent command(const Eigen::Vector2d& pan_tilt_rad);
  /// The same without a pause after the question before it: the pause comes later.
  HeadSent command_at_once(const Eigen::Vector2d& pan_tilt_rad);
  void zoom_to(double share);
  /// Stops the head; throws InputError where that fails.
  void stop();
  /// Until then. Throws Interrupted after Ctrl-C.
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
  std::optional<Eigen::Vector2d> rests_at_;  ///< Where it was before it moved.
  double next_question_s_ = 0.0;
  bool has_moved_ = false;
};

}  // namespace alidade
