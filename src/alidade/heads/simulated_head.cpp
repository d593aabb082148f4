#include "alidade/heads/simulated_head.h"

#include <fmt/format.h>

#include <cmath>
#include <cstdlib>
#include <map>

#include "alidade/files/files.h"
#include "alidade/geometry/degree.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// A time of its own: waiting costs nothing.
class FreeClock final : public HeadClock {
 public:
  [[nodiscard]] double now_s() const override { return now_s_; }
  void wait_until(double t_s) override { now_s_ = std::max(now_s_, t_s); }
  [[nodiscard]] bool is_free() const override { return true; }

 private:
  double now_s_ = 1.7e9;
};

const std::map<std::string, HeadLie>& lies() {
  static const std::map<std::string, HeadLie> words{{"none", HeadLie::none},
                                                    {"refuses", HeadLie::refuses},
                                                    {"reports-target", HeadLie::reports_target},
                                                    {"silent", HeadLie::silent},
                                                    {"nan", HeadLie::not_a_number},
                                                    {"frozen", HeadLie::frozen},
                                                    {"zoom-moves-pan", HeadLie::zoom_moves_pan}};
  return words;
}

class SimulatedHead final : public HeadDevice {
 public:
  SimulatedHead(std::string url, const SimulatedHeadConfig& config, std::shared_ptr<HeadClock> clock)
      : name_(std::move(url)), clock_(std::move(clock)), plant_(config, clock_->now_s()) {}

  [[nodiscard]] HeadLimits limits() override {
    return {plant_.config().low_rad, plant_.config().high_rad, true, "simulated"};
  }
  [[nodiscard]] const std::string& name() const override { return name_; }
  [[nodiscard]] HeadClock& clock() override { return *clock_; }

  [[nodiscard]] HeadPosition position() override {
    const double t_s = heard();
    const Eigen::Vector2d angles = plant_.reading(t_s);
    if (!angles.allFinite()) throw InputError(name_ + ": 'nan' is no angle of a head");
    return {t_s, 0.0, angles};
  }
  HeadSent command(const Eigen::Vector2d& pan_tilt_rad) override {
    if (!limits().hold(pan_tilt_rad)) throw InputError(name_ + ": a command that is no angle within its limits");
    const double t_s = heard();
    plant_.go_to(t_s, pan_tilt_rad);
    return {t_s, 0.0};
  }
  HeadSent stop() override {
    const double t_s = clock_->now_s();
    plant_.stop(t_s);
    return {t_s, 0.0};
  }
  [[nodiscard]] std::optional<double> zoom() override {
    if (!plant_.config().has_zoom) return std::nullopt;
    (void)heard();
    return plant_.zoom();
  }
  void zoom_to(double share) override { plant_.zoom_to(heard(), share); }
  [[nodiscard]] HeadPlant& plant() { return plant_; }

 private:
  double heard() {
    const double t_s = clock_->now_s();
    if (plant_.does(HeadLie::silent, t_s)) {
      clock_->wait_until(t_s + HeadOptions{}.timeout_s);
      throw InputError(fmt::format("{}: no answer within {:g} s", name_, HeadOptions{}.timeout_s));
    }
    plant_.hear(t_s);
    return t_s;
  }

  std::string name_;
  std::shared_ptr<HeadClock> clock_;
  HeadPlant plant_;
};

}  // namespace

SimulatedHeadConfig drawn_head(std::uint64_t seed) {
  Draws draws(seed);
  const auto uniform = [&](double low, double high) { return draws.uniform(low, high); };
  const auto either = [&](double low, double high) { return uniform(0.0, 1.0) < 0.5 ? 0.0 : uniform(low, high); };
  const auto one_of = [&](const std::array<double, 4>& values) {
    return values[static_cast<std::size_t>(uniform(0.0, 4.0))];
  };
  SimulatedHeadConfig head;
  head.seed = seed;
  head.axis.rate_rad_s = uniform(10.0, 90.0) * degree;
  head.axis.acceleration_rad_s2 = uniform(80.0, 400.0) * degree;
  head.axis.time_constant_s = uniform(0.04, 0.15);
  head.axis.backlash_rad = either(0.05, 0.4) * degree;
  head.axis.latency_s = uniform(0.01, 0.15);
  head.axis.dead_band_rad = either(0.03, 0.2) * degree;
  head.step_rad = one_of({0.01, 0.01, 0.02, 0.05}) * degree;
  head.update_hz = one_of({0.0, 0.0, 50.0, 20.0});
  return head;
}

namespace {

struct HeadNumber {
  double* target;
  double unit;
};
std::map<std::string, HeadNumber> numbers_of(SimulatedHeadConfig& head) {
  PositionerParams& axis = head.axis;
  return {{"rate", {&axis.rate_rad_s, degree}},       {"accel", {&axis.acceleration_rad_s2, degree}},
          {"tau", {&axis.time_constant_s, 1.0}},      {"latency", {&axis.latency_s, 1.0}},
          {"backlash", {&axis.backlash_rad, degree}}, {"dead_band", {&axis.dead_band_rad, degree}},
          {"step", {&head.step_rad, degree}},         {"grid", {&head.command_step_rad, degree}},
          {"update_hz", {&head.update_hz, 1.0}},      {"repeat", {&head.repeatability_rad, degree}},
          {"watchdog", {&head.watchdog_s, 1.0}},      {"lie_after", {&head.lie_after_s, 1.0}},
          {"min_pan", {&head.low_rad[0], degree}},    {"max_pan", {&head.high_rad[0], degree}},
          {"min_tilt", {&head.low_rad[1], degree}},   {"max_tilt", {&head.high_rad[1], degree}}};
}

/// Throws where the key is none.
void take_key(const std::string& key, const std::string& value, const std::string& where, SimulatedHeadConfig& head) {
  if (key == "clock" && value == "free") return;
  char* last = nullptr;
  const double number = std::strtod(value.c_str(), &last);
  const bool is_number = !value.empty() && *last == '\0' && std::isfinite(number) && std::abs(number) < 1e9;
  const bool may_be_below_zero = key.starts_with("min_") || key.starts_with("max_");
  const std::map<std::string, HeadNumber> numbers = numbers_of(head);
  std::string known = "clock=free, lie, seed, zoom";
  for (const auto& [name, number_of_it] : numbers) known += ", " + name;
  if (key == "lie") {
    std::string words;
    for (const auto& [word, lie] : lies()) words += (words.empty() ? "" : ", ") + word;
    if (!lies().contains(value)) throw InputError(fmt::format("{}: no lie '{}'; there are {}", where, value, words));
    head.lie = lies().at(value);
  } else if (key != "seed" && key != "zoom" && !numbers.contains(key)) {
    throw InputError(fmt::format("{}: a simulated head has no '{}'; it has {}", where, key, known));
  } else if (!is_number || (number < 0.0 && !may_be_below_zero)) {
    throw InputError(fmt::format("{}: '{}={}' is no number that a head can have", where, key, value));
  } else if (key == "zoom") {
    head.has_zoom = number > 0.0;
  } else if (key == "seed") {
    head = drawn_head(static_cast<std::uint64_t>(number));
  } else {
    *numbers.at(key).target = number * numbers.at(key).unit;
  }
}

}  // namespace

SimulatedHeadConfig simulated_head_config(const std::string& text, const std::string& where) {
  SimulatedHeadConfig head;
  head.axis = {.rate_rad_s = 40.0 * degree, .acceleration_rad_s2 = 120.0 * degree};
  for (std::size_t at = 0; at < text.size();) {
    const std::size_t end = std::min(text.find_first_of("&,", at), text.size());
    const std::string part = text.substr(at, end - at), key = part.substr(0, part.find('='));
    at = end + 1;
    if (!part.empty()) take_key(key, part.size() > key.size() ? part.substr(key.size() + 1) : "", where, head);
  }
  const PositionerParams& axis = head.axis;
  const bool can_move = axis.rate_rad_s > 0.0 && axis.acceleration_rad_s2 > 0.0 && axis.time_constant_s > 0.0;
  if (!can_move) throw InputError(where + ": rate, accel and tau must be above zero");
  if (!(head.low_rad.array() <= head.high_rad.array()).all())
    throw InputError(where + ": min_pan and min_tilt are not above max_pan and max_tilt");
  return head;
}

HeadPlant::HeadPlant(const SimulatedHeadConfig& config, double t_s)
    : config_(config), begin_s_(t_s), axes_{Positioner(config.axis, 0.0, 0.0), Positioner(config.axis, 0.0, 0.0)} {
  const Eigen::Vector2d start = Eigen::Vector2d::Zero().cwiseMax(config.low_rad).cwiseMin(config.high_rad);
  for (std::size_t i = 0; i < 2; ++i) axes_[i] = Positioner(config.axis, start[static_cast<Eigen::Index>(i)], 0.0);
  sampled_ = target_ = start;
}

void HeadPlant::advance(double t_s) {
  const double until = t_s - begin_s_;
  if (config_.watchdog_s > 0.0 && until > heard_s_ + config_.watchdog_s) {
    for (Positioner& axis : axes_) {
      axis.advance(heard_s_ + config_.watchdog_s);
      if (!axis.is_at_rest()) axis.cut(axis.time_s());
    }
    heard_s_ = until;
  }
  if (until >= turns_until_s_) {
    for (Positioner& axis : axes_) axis.advance(turns_until_s_), axis.stop(turns_until_s_);
    turns_until_s_ = 1e300;
  }
  if (config_.update_hz > 0.0) {
    const auto sample = static_cast<std::int64_t>(std::floor(until * config_.update_hz));
    for (Positioner& axis : axes_) axis.advance(static_cast<double>(sample) / config_.update_hz);
    if (sample > sample_) sampled_ = output();
    sample_ = std::max(sample, sample_);
  }
  for (Positioner& axis : axes_) axis.advance(until);
}

bool HeadPlant::does(HeadLie lie, double t_s) const {
  return config_.lie == lie && moved_s_ >= 0.0 && t_s - begin_s_ >= moved_s_ + config_.lie_after_s;
}

void HeadPlant::hear(double t_s) {
  const std::scoped_lock lock(mutex_);
  advance(t_s);
  heard_s_ = std::max(heard_s_, t_s - begin_s_);
}

/// Lies count from the first command on.
void HeadPlant::begin_motion(double t_s) {
  advance(t_s);
  turns_until_s_ = 1e300;
  if (moved_s_ < 0.0) moved_s_ = t_s - begin_s_;
}

void HeadPlant::send(double t_s, const Eigen::Vector2d& target) {
  target_ = target;
  if (does(HeadLie::refuses, t_s)) return;
  for (std::size_t i = 0; i < 2; ++i) axes_[i].go_to(t_s - begin_s_, target[static_cast<Eigen::Index>(i)]);
}

void HeadPlant::go_to(double t_s, const Eigen::Vector2d& pan_tilt_rad) {
  const std::scoped_lock lock(mutex_);
  begin_motion(t_s);
  Draws draws(config_.seed * 1000003u + ++draws_);
  const double step = config_.command_step_rad;
  Eigen::Vector2d target = pan_tilt_rad;
  if (step > 0.0) target = (target / step).array().round() * step;
  target = target.cwiseMax(config_.low_rad).cwiseMin(config_.high_rad);
  for (double& angle : target) angle += config_.repeatability_rad * draws.normal();
  send(t_s, target);
}

void HeadPlant::turn(double t_s, const Eigen::Vector2d& direction, double until_s) {
  const std::scoped_lock lock(mutex_);
  begin_motion(t_s);
  Eigen::Vector2d target = target_;
  for (int i = 0; i < 2; ++i) {
    if (direction[i] > 0.0) target[i] = config_.high_rad[i];
    if (direction[i] < 0.0) target[i] = config_.low_rad[i];
  }
  send(t_s, target);
  turns_until_s_ = until_s - begin_s_;
}

void HeadPlant::zoom_to(double t_s, double share) {
  constexpr double moves_rad = 1.5 * degree;
  const std::scoped_lock lock(mutex_);
  begin_motion(t_s);
  const double way = share - zoom_;
  zoom_ = share;
  if (does(HeadLie::zoom_moves_pan, t_s)) send(t_s, target_ + Eigen::Vector2d(way > 0.0 ? moves_rad : -moves_rad, 0.0));
}

void HeadPlant::stop(double t_s) {
  const std::scoped_lock lock(mutex_);
  advance(t_s);
  turns_until_s_ = 1e300;
  for (Positioner& axis : axes_) axis.stop(t_s - begin_s_);
}

Eigen::Vector2d HeadPlant::reading(double t_s) {
  const std::scoped_lock lock(mutex_);
  advance(t_s);
  if (does(HeadLie::not_a_number, t_s)) return Eigen::Vector2d::Constant(std::nan(""));
  Eigen::Vector2d angles = config_.update_hz > 0.0 ? sampled_ : output();
  if (does(HeadLie::reports_target, t_s)) angles = target_;
  if (does(HeadLie::frozen, t_s)) {
    if (kept_[0] > 1e8) kept_ = angles;
    angles = kept_;
  }
  if (!(config_.step_rad > 0.0)) return angles;
  return (angles / config_.step_rad).array().round() * config_.step_rad;
}

Eigen::Vector2d HeadPlant::truth(double t_s) {
  const std::scoped_lock lock(mutex_);
  advance(t_s);
  return output();
}

bool HeadPlant::is_at_rest(double t_s) {
  const std::scoped_lock lock(mutex_);
  advance(t_s);
  return axes_[0].is_at_rest() && axes_[1].is_at_rest();
}

HeadPlant* plant_of(HeadDevice& head) {
  auto* simulated = dynamic_cast<SimulatedHead*>(&head);
  return simulated != nullptr ? &simulated->plant() : nullptr;
}

std::unique_ptr<HeadDevice> open_simulated_head(const std::string& url) {
  const std::size_t query = url.find('?');
  const std::string text = query == std::string::npos ? "" : url.substr(query + 1);
  std::shared_ptr<HeadClock> clock = machine_clock();
  if (text.find("clock=free") != std::string::npos) clock = std::make_shared<FreeClock>();
  return std::make_unique<SimulatedHead>(url, simulated_head_config(text, url), clock);
}

}  // namespace alidade
