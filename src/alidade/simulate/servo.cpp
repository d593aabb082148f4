#include "alidade/simulate/servo.h"

#include <algorithm>
#include <cmath>
#include <deque>
#include <numbers>
#include <optional>

#include "alidade/pantilt/intrinsics_history.h"
#include "alidade/simulate/track.h"

namespace alidade {
namespace {

constexpr std::array<std::string_view, 6> path_names{"still", "circle", "sway", "step", "manoeuvre", "recorded"};

/// Velocity at a point of the record: of the parabola through its neighbours, at the ends of the line.
Eigen::Vector3d velocity_at(const TargetPath& path, std::size_t i) {
  const auto slope = [&](std::size_t k) {
    return Eigen::Vector3d((path.recorded_m[k + 1] - path.recorded_m[k]) /
                           (path.recorded_s[k + 1] - path.recorded_s[k]));
  };
  const std::size_t last = path.recorded_s.size() - 1;
  if (i == 0) return slope(0);
  if (i == last) return slope(last - 1);
  const double before_s = path.recorded_s[i] - path.recorded_s[i - 1];
  const double after_s = path.recorded_s[i + 1] - path.recorded_s[i];
  return (after_s * slope(i - 1) + before_s * slope(i)) / (before_s + after_s);
}

Eigen::Vector3d recorded_at(const TargetPath& path, double t_s) {
  if (path.recorded_s.empty()) return path.start_m;
  const auto after = std::ranges::upper_bound(path.recorded_s, t_s);
  if (after == path.recorded_s.begin()) return path.recorded_m.front();
  if (after == path.recorded_s.end()) return path.recorded_m.back();
  const auto i = static_cast<std::size_t>(after - path.recorded_s.begin()) - 1;
  const double dt = path.recorded_s[i + 1] - path.recorded_s[i], s = (t_s - path.recorded_s[i]) / dt, r = 1.0 - s;
  return r * r * (1.0 + 2.0 * s) * path.recorded_m[i] + s * s * (1.0 + 2.0 * r) * path.recorded_m[i + 1] +
         s * r * dt * (r * velocity_at(path, i) - s * velocity_at(path, i + 1));
}

double rounded_to(double value, double step) { return step > 0.0 ? step * std::round(value / step) : value; }

DelayedAxis standing(const ServoAxis& axis, double angle_rad) {
  DelayedAxis still(axis, {angle_rad, 0.0});
  // The command under which it has rested there so far.
  double command = std::holds_alternative<AnglePlant>(axis.plant) ? angle_rad / gain_of(axis.plant) : 0.0;
  if (command != 0.0) command += std::copysign(axis.dead_band, command);
  still.send(command);
  if (axis.command_delay_s > 0.0) still.advance(axis.command_delay_s);
  still.set_motion({angle_rad, 0.0});
  return still;
}

double step_of(const ServoLogScene& scene, double t_s) {
  if (t_s < scene.step_at_s || scene.steps.empty()) return 0.0;
  const auto done = static_cast<std::size_t>((t_s - scene.step_at_s) / scene.hold_s + 1e-9);
  return scene.steps[done % scene.steps.size()];
}

double command_of(const ServoLogScene& scene, double t_s) {
  if (!scene.is_chirp) return scene.amplitude * step_of(scene, t_s);
  const double sweep_hz = scene.low_hz + 0.5 * (scene.high_hz - scene.low_hz) * t_s / scene.duration_s;
  return scene.amplitude * std::sin(2.0 * std::numbers::pi * sweep_hz * t_s);
}

/// An axis without delay, whose rate may fall behind as it grows, and what swings behind it.
class SwingingAxis {
 public:
  SwingingAxis(const ServoAxis& axis, const Mode& mode, double soft_max_rate_rad_s)
      : axis_(axis, {}), mode_(mode), soft_max_rate_rad_s_(soft_max_rate_rad_s) {
    if (mode.hz > 0.0) swinging_.emplace(mode, DriveMotion{});
  }
  void send(double command) {
    command_ = command;
    axis_.send(soft_max_rate_rad_s_ > 0.0 ? softened(command) : command);
  }
  void advance(double dt_s) {
    const bool is_soft = soft_max_rate_rad_s_ > 0.0;
    const double longest_s = is_soft ? 1e-5 : 1e-4;  // for so long the drive's motion is a line
    const double steps = swinging_ || is_soft ? std::max(1.0, std::ceil(dt_s / longest_s)) : 1.0, step_s = dt_s / steps;
    for (double k = 0.0; k < steps; ++k) {
      const double before = axis_.motion().angle_rad;
      if (is_soft) axis_.send(softened(command_));
      axis_.advance(step_s);
      if (!swinging_ || !(step_s > 0.0)) continue;
      const double after = axis_.motion().angle_rad, rate = (after - before) / step_s;
      swinging_->advance(step_s, {before, rate}, {after, rate});
    }
  }
  [[nodiscard]] double angle_rad() const {
    const double drive = axis_.motion().angle_rad;
    return swinging_ ? drive + mode_.share * (swinging_->angle_rad() - drive) : drive;
  }

 private:
  /// The command towards which the lag alone turns the axis at the rate at which it does turn towards this one.
  [[nodiscard]] double softened(double command) const {
    const ServoAxis& axis = axis_.axis();
    const double gain = gain_of(axis.plant);
    if (std::holds_alternative<RatePlant>(axis.plant))
      return command / (1.0 + std::abs(gain * command) / soft_max_rate_rad_s_);
    const double tau_s = tau_of(axis.plant), now = axis_.motion().angle_rad;
    const double rate = (gain * command - now) / tau_s;
    return (now + tau_s * rate / (1.0 + std::abs(rate) / soft_max_rate_rad_s_)) / gain;
  }

  DelayedAxis axis_;
  Mode mode_;
  double soft_max_rate_rad_s_ = 0.0, command_ = 0.0;
  std::optional<Resonance> swinging_;
};

}  // namespace

std::string_view path_name(PathKind kind) { return path_names[static_cast<std::size_t>(kind)]; }

std::optional<PathKind> path_named(std::string_view name) {
  for (std::size_t i = 0; i + 1 < path_names.size(); ++i)
    if (path_names[i] == name) return static_cast<PathKind>(i);
  return std::nullopt;
}

Eigen::Vector3d TargetPath::at(double t_s) const {
  const double angle = 2.0 * std::numbers::pi * t_s / period_s;
  switch (kind) {
    case PathKind::circle:
      return start_m + circle_offset(radius_m, period_s, t_s);
    case PathKind::sway:
      return start_m + Eigen::Vector3d(radius_m * std::sin(angle), 0.0, 0.0);
    case PathKind::step:
      return t_s < jump_at_s ? start_m : Eigen::Vector3d(start_m + jump_m);
    case PathKind::manoeuvre:
      return manoeuvre_position(t_s);
    case PathKind::recorded:
      return recorded_at(*this, t_s);
    case PathKind::still:
      break;
  }
  return start_m;
}

double ZoomProfile::at(double at_s) const {
  if (t_s.empty()) return 1.0;
  const auto after = std::ranges::lower_bound(t_s, at_s);
  if (after == t_s.begin()) return factor.front();
  if (after == t_s.end()) return factor.back();
  const auto i = static_cast<std::size_t>(after - t_s.begin());
  const double share = (at_s - t_s[i - 1]) / (t_s[i] - t_s[i - 1]);
  return std::exp((1.0 - share) * std::log(factor[i - 1]) + share * std::log(factor[i]));
}

double ZoomProfile::largest() const { return factor.empty() ? 1.0 : std::ranges::max(factor); }

bool ZoomProfile::is_still() const {
  return std::ranges::all_of(factor, [](double one) { return one == 1.0; });
}

SimulatedHead::SimulatedHead(const HeadTruth& truth, const Eigen::Vector2d& pan_tilt_rad, std::uint64_t seed)
    : truth_(truth),
      axes_{standing(truth.axes[0], pan_tilt_rad.x()), standing(truth.axes[1], pan_tilt_rad.y())},
      draws_(seed),
      background_draws_(seed + 500009),
      intrinsics_(own_lens(truth.head.camera).k) {}

void SimulatedHead::zoom_to(double factor) {
  intrinsics_ = own_lens(truth_.head.camera).k;
  intrinsics_.head<2>() *= factor;
}

void SimulatedHead::send(const Eigen::Vector2d& command) {
  axes_[0].send(command.x());
  axes_[1].send(command.y());
}

void SimulatedHead::advance(double dt_s) {
  for (DelayedAxis& axis : axes_) axis.advance(dt_s);
}

Eigen::Vector2d SimulatedHead::angles_rad() const { return {axes_[0].motion().angle_rad, axes_[1].motion().angle_rad}; }

Eigen::Vector2d SimulatedHead::rates_rad_s() const {
  return {axes_[0].motion().rate_rad_s, axes_[1].motion().rate_rad_s};
}

Eigen::Vector2d SimulatedHead::read_encoders() {
  const Eigen::Vector2d noisy = angles_rad() + truth_.sigma_encoder_rad * draws_.normal2();
  return {rounded_to(noisy.x(), truth_.encoder_step_rad), rounded_to(noisy.y(), truth_.encoder_step_rad)};
}

std::optional<Eigen::Vector2d> SimulatedHead::pixel_at(const Eigen::Vector2d& angles_rad,
                                                       const Eigen::Vector3d& target_in_world) const {
  const auto seen = project(truth_.head, angles_rad, target_in_world);
  if (!seen) return std::nullopt;
  return Zoomed(truth_.head.camera, intrinsics_).px(seen->px);
}

std::optional<Eigen::Vector2d> SimulatedHead::true_pixel(const Eigen::Vector3d& target_in_world) const {
  return pixel_at(angles_rad(), target_in_world);
}

std::optional<Eigen::Vector2d> SimulatedHead::true_pixel_after(double dt_s,
                                                               const Eigen::Vector3d& target_in_world) const {
  std::array<DelayedAxis, 2> then = axes_;
  for (DelayedAxis& axis : then) axis.advance(dt_s);
  return pixel_at({then[0].motion().angle_rad, then[1].motion().angle_rad}, target_in_world);
}

std::vector<Eigen::Vector2d> SimulatedHead::seen_background() {
  constexpr double nan = std::numeric_limits<double>::quiet_NaN();
  std::vector<Eigen::Vector2d> pixels;
  for (const Eigen::Vector3d& point : truth_.background_in_world) {
    const Eigen::Vector2d noise_px = truth_.sigma_px * background_draws_.normal2();
    const auto px = true_pixel(point);
    const bool is_there = px && is_in_image(truth_.head.camera, *px + noise_px);
    pixels.push_back(is_there ? Eigen::Vector2d(*px + noise_px) : Eigen::Vector2d::Constant(nan));
  }
  return pixels;
}

std::optional<Eigen::Vector2d> SimulatedHead::seen_pixel(const Eigen::Vector3d& target_in_world) {
  const Eigen::Vector2d noise_px = truth_.sigma_px * draws_.normal2();  // drawn always: what is hidden shifts no seed
  const auto px = true_pixel(target_in_world);
  if (!px || !is_in_image(truth_.head.camera, *px + noise_px)) return std::nullopt;
  return *px + noise_px;
}

std::vector<ServoLogRow> simulate_servo_log(const ServoLogScene& scene, std::uint64_t seed) {
  Draws draws(seed);
  // Commands wait here: a DelayedAxis has room for a few only.
  ServoAxis prompt = scene.axis;
  prompt.command_delay_s = 0.0;
  SwingingAxis axis(prompt, scene.mode, scene.soft_max_rate_rad_s);
  std::deque<ServoLogRow> waiting;
  std::vector<ServoLogRow> rows;
  const int per_row = std::max(1, scene.commands_per_row);
  const double rate_hz = scene.rate_hz * per_row;
  const int num_rows = static_cast<int>(std::floor(scene.duration_s * scene.rate_hz)) + 1;
  for (int k = 0; k <= (num_rows - 1) * per_row; ++k) {
    ServoLogRow row;
    row.t_s = k / rate_hz;
    row.command = command_of(scene, row.t_s);
    if (k % per_row == 0) {
      const double turned_rad = scene.zero_rad + axis.angle_rad() + scene.rate_offset_rad_s * row.t_s;
      row.angle_rad = rounded_to(turned_rad + scene.sigma_rad * draws.normal(), scene.encoder_step_rad);
      rows.push_back(row);
    }
    waiting.push_back(row);
    const double next_s = (k + 1) / rate_hz;
    double now_s = row.t_s;
    for (; !waiting.empty() && waiting.front().t_s + scene.axis.command_delay_s <= next_s; waiting.pop_front()) {
      const double acts_s = std::max(now_s, waiting.front().t_s + scene.axis.command_delay_s);
      axis.advance(acts_s - now_s);
      const double command = waiting.front().command;
      axis.send(scene.max_command > 0.0 ? std::clamp(command, -scene.max_command, scene.max_command) : command);
      now_s = acts_s;
    }
    axis.advance(next_s - now_s);
  }
  return rows;
}

}  // namespace alidade
