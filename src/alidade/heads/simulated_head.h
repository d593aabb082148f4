#pragma once

#include <Eigen/Core>
#include <array>
#include <atomic>
#include <cstdint>
#include <deque>
#include <memory>
#include <mutex>
#include <string>

#include "alidade/heads/head_device.h"
#include "alidade/pantilt/positioner.h"

namespace alidade {

/// Faults of a head: what it does instead of what it reports.
enum class HeadLie {
  none,
  refuses,         ///< Accepts commands and does not move.
  reports_target,  ///< Reports its target, not its position.
  silent,          ///< Stops replying.
  not_a_number,    ///< Reports NaN.
  frozen,          ///< Moves, and reports its old position.
  zoom_moves_pan   ///< A zoom command alone moves pan as well.
};

/// A realistic head. Both axes are alike.
struct SimulatedHeadConfig {
  PositionerParams axis;
  double step_rad = 0.01 * 0.017453292519943295;  ///< Of the encoder.
  double update_hz = 0.0;                         ///< Of the encoder; 0: read on request.
  double command_step_rad = 0.0;                  ///< Commands are rounded to multiples of it; 0: they are not.
  bool has_zoom = false;
  double repeatability_rad = 0.0;  ///< σ of the final position of a command.
  Eigen::Vector2d low_rad{-2.96705972839036, -0.523598775598299};
  Eigen::Vector2d high_rad{2.96705972839036, 1.047197551196598};
  double watchdog_s = 0.0;      ///< Silence after which it stops by itself; 0: never.
  HeadLie lie = HeadLie::none;  ///< From `lie_after_s` after the first command on.
  double lie_after_s = 0.0;
  std::uint64_t seed = 1;
};

/// A plant drawn with `seed`: rate 10–90°/s, acceleration 80–400°/s², time constant 0.04–0.15 s, latency 10–150 ms,
/// backlash and dead band often, an encoder of 0.01–0.05° that is read on request or 20 or 50 times a second.
[[nodiscard]] SimulatedHeadConfig drawn_head(std::uint64_t seed);

/// The config from "KEY=VALUE&KEY=VALUE" (or separated by commas): seed, rate, accel, backlash, dead_band, step, grid,
/// repeat in degrees and their rates; tau, latency, watchdog in seconds; update_hz; zoom; lie. Throws InputError, which
/// lists all keys if one is unknown.
[[nodiscard]] SimulatedHeadConfig simulated_head_config(const std::string& text, const std::string& where);

/// The plant over time. Thread-safe; times never decrease.
class HeadPlant {
 public:
  HeadPlant(const SimulatedHeadConfig& config, double t_s);
  void go_to(double t_s, const Eigen::Vector2d& pan_tilt_rad);
  void stop(double t_s);
  [[nodiscard]] Eigen::Vector2d reading(double t_s);
  [[nodiscard]] Eigen::Vector2d truth(double t_s);  ///< True direction of a camera on it.
  /// Moves in the directions of the signs, at its largest rate, until `until_s` or the next command.
  void turn(double t_s, const Eigen::Vector2d& direction, double until_s);
  void zoom_to(double t_s, double share);
  [[nodiscard]] double zoom() const { return zoom_; }
  [[nodiscard]] bool is_at_rest(double t_s);
  /// A client has spoken: the watchdog restarts.
  void hear(double t_s);
  [[nodiscard]] bool does(HeadLie lie, double t_s) const;
  [[nodiscard]] const SimulatedHeadConfig& config() const { return config_; }

 private:
  void advance(double t_s);
  void send(double t_s, const Eigen::Vector2d& target);
  void begin_motion(double t_s);
  [[nodiscard]] Eigen::Vector2d output() const { return {axes_[0].output_rad(), axes_[1].output_rad()}; }

  SimulatedHeadConfig config_;
  mutable std::mutex mutex_;
  double begin_s_, heard_s_ = 0.0;
  std::atomic<double> moved_s_ = -1.0;
  std::array<Positioner, 2> axes_;
  Eigen::Vector2d target_ = Eigen::Vector2d::Zero(), sampled_ = Eigen::Vector2d::Zero(),
                  kept_ = Eigen::Vector2d::Constant(1e9);
  std::int64_t sample_ = -1;
  double turns_until_s_ = 1e300;
  std::atomic<double> zoom_ = 0.0;
  std::uint64_t draws_ = 0;
};

/// For a head simulated in this program; null: it is another.
[[nodiscard]] HeadPlant* plant_of(HeadDevice& head);

/// sim://?seed=3: such a head in this program. `clock=free`: with its own time, which runs as fast as it is asked.
[[nodiscard]] std::unique_ptr<HeadDevice> open_simulated_head(const std::string& url);

}  // namespace alidade
