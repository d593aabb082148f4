#include "alidade/observe/turn_patterns.h"

#include <cmath>
#include <functional>

#include "alidade/geometry/so3.h"
#include "alidade/observe/rotation_frame.h"

namespace alidade {
namespace {

/// A measured rotation that is off by `amount` of a cause.
using Disturb = std::function<void(RotationRow& row, std::size_t index, double amount)>;

/// The rows without their pixels.
RotationLog bare(const RotationLog& log) {
  RotationLog copy;
  copy.source = log.source;
  copy.has_roll_rate = log.has_roll_rate;
  copy.rows.resize(log.rows.size());
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    copy.rows[k].t_s = log.rows[k].t_s;
    copy.rows[k].rate_rad_per_s = log.rows[k].rate_rad_per_s;
    copy.rows[k].pan_tilt_roll_rad = log.rows[k].pan_tilt_roll_rad;
    copy.rows[k].base_from_cam = log.rows[k].base_from_cam;
  }
  return copy;
}

std::vector<Eigen::Quaterniond> turned_since_start(const RotationLog& log, double max_gap_s) {
  std::vector<Eigen::Quaterniond> turned;
  turned.reserve(log.rows.size());
  MotionReader reader(log.source, max_gap_s);
  for (const RotationRow& row : log.rows) turned.push_back(reader.next(row).cam_from_start);
  return turned;
}

class Patterns {
 public:
  Patterns(const RotationLog& log, double max_gap_s)
      : log_(bare(log)), max_gap_s_(max_gap_s), as_measured_(turned_since_start(log_, max_gap_s)) {}

  std::vector<TurnPattern> take() { return std::move(patterns_); }

  /// By a difference: rotations are smooth in what is measured.
  void add(const std::string& cause, const std::string& member, const std::string& unit, double step,
           const Disturb& disturb) {
    RotationLog off = log_;
    for (std::size_t k = 0; k < off.rows.size(); ++k) disturb(off.rows[k], k, step);
    const std::vector<Eigen::Quaterniond> turned = turned_since_start(off, max_gap_s_);
    TurnPattern pattern{cause, member, unit, {}};
    pattern.turn_rad.reserve(turned.size());
    for (std::size_t k = 0; k < turned.size(); ++k) {
      pattern.turn_rad.emplace_back(log_so3((turned[k] * as_measured_[k].conjugate()).normalized()) / step);
    }
    patterns_.push_back(std::move(pattern));
  }

  void add_head();
  void add_rate();
  void add_attitude();

 private:
  /// ±1: the way the axis last turned.
  [[nodiscard]] std::vector<double> direction(Eigen::Index axis) const;

  RotationLog log_;
  double max_gap_s_;
  std::vector<Eigen::Quaterniond> as_measured_;
  std::vector<TurnPattern> patterns_;
};

std::vector<double> Patterns::direction(Eigen::Index axis) const {
  constexpr double still_rad = 1e-6;  // encoders' last digit is no motion
  std::vector<double> way(log_.rows.size(), 0.0);
  double now = 0.0, turned_at = not_seen;
  for (std::size_t k = 0; k < way.size(); ++k) {
    const double angle = log_.rows[k].pan_tilt_roll_rad[axis];
    if (std::isfinite(angle)) {
      if (std::isfinite(turned_at) && std::abs(angle - turned_at) > still_rad) now = angle > turned_at ? 1.0 : -1.0;
      turned_at = angle;
    }
    way[k] = now;
  }
  return way;
}

void Patterns::add_head() {
  static const char* const names[] = {"of pan", "of tilt"};
  const double start_s = log_.rows.front().t_s;
  for (Eigen::Index axis = 0; axis < 2; ++axis) {
    const char* member = names[axis];
    const auto angle = [axis](RotationRow& row) -> double& { return row.pan_tilt_roll_rad[axis]; };
    add("encoder scale", member, "", 1e-5,
        [&](RotationRow& row, std::size_t, double amount) { angle(row) *= 1.0 + amount; });
    add("zero that drifts", member, "rad/s", 1e-6,
        [&](RotationRow& row, std::size_t, double amount) { angle(row) += amount * (row.t_s - start_s); });
    const std::vector<double> way = direction(axis);
    add("backlash", member, "rad", 1e-6,
        [&](RotationRow& row, std::size_t k, double amount) { angle(row) += 0.5 * amount * way[k]; });
    const auto curve = [&](const std::string& word, double (*of)(double), double times) {
      add("error of the angles within a turn", word + " " + member, "rad", 1e-6,
          [&](RotationRow& row, std::size_t, double amount) { angle(row) += amount * of(times * angle(row)); });
    };
    curve(
        "sin", [](double a) { return std::sin(a); }, 1.0);
    curve(
        "cos", [](double a) { return std::cos(a); }, 1.0);
    curve(
        "sin 2×", [](double a) { return std::sin(a); }, 2.0);
    curve(
        "cos 2×", [](double a) { return std::cos(a); }, 2.0);
  }
}

void Patterns::add_rate() {
  static const char* const names[] = {"of ω_x", "of ω_y", "of ω_z"};
  for (Eigen::Index axis = 0; axis < (log_.has_roll_rate ? 3 : 2); ++axis) {
    const auto rate = [axis](RotationRow& row) -> double& { return row.rate_rad_per_s[axis]; };
    add("scale of the rates", names[axis], "", 1e-5,
        [&](RotationRow& row, std::size_t, double amount) { rate(row) *= 1.0 + amount; });
  }
  for (Eigen::Index axis = 0; axis < 3; ++axis) {
    add("bias of the rates", names[axis], "rad/s", 1e-6,
        [axis](RotationRow& row, std::size_t, double amount) { row.rate_rad_per_s[axis] += amount; });
  }
}

void Patterns::add_attitude() {
  static const char* const names[] = {"about x", "about y", "about z"};
  const double start_s = log_.rows.front().t_s;
  for (int axis = 0; axis < 3; ++axis) {
    add("attitude that drifts", names[axis], "rad/s", 1e-6, [&](RotationRow& row, std::size_t, double amount) {
      const Eigen::Vector3d turn = amount * (row.t_s - start_s) * Eigen::Vector3d::Unit(axis);
      row.base_from_cam = exp_so3(turn) * row.base_from_cam;
    });
  }
}

}  // namespace

std::vector<TurnPattern> turn_patterns(const RotationLog& log, double max_gap_s) {
  if (log.rows.empty() || log.source == RotationSource::none) return {};
  Patterns patterns(log, max_gap_s);
  if (log.source == RotationSource::head) patterns.add_head();
  if (log.source == RotationSource::rate) patterns.add_rate();
  if (log.source == RotationSource::attitude) patterns.add_attitude();
  return patterns.take();
}

}  // namespace alidade
