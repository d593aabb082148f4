#include "alidade/observe/rotation_frame.h"

#include <algorithm>

#include "alidade/geometry/so3.h"
#include "alidade/pantilt/head_rotation.h"

namespace alidade {
namespace {

/// ∫ω over the last step of length `h`, after one of length `h0`: from the parabola through three samples.
Eigen::Vector3d integral(const Eigen::Vector3d& before, const Eigen::Vector3d& last, const Eigen::Vector3d& now,
                         double h0, double h) {
  const double r = h / h0;
  const double of_before = -r * r / (6.0 * (1.0 + r));
  const double of_now = (3.0 + 2.0 * r) / (6.0 * (1.0 + r));
  const double of_last = 1.0 - of_before - of_now;
  return h * (of_before * before + of_last * last + of_now * now);
}

}  // namespace

RotationFrame MotionReader::next(const RotationRow& row) {
  RotationFrame frame;
  frame.t_s = row.t_s;
  frame.dt_s = has_last_ ? row.t_s - last_t_s_ : 0.0;
  frame.cam_from_start = cam_from_start_;
  frame.shift_m = shift_m_;
  const std::optional<Eigen::Quaterniond> attitude = attitude_of(row);
  const bool is_measured = source_ == RotationSource::none ||
                           (source_ == RotationSource::rate ? row.rate_rad_per_s.allFinite() : attitude.has_value());
  if (!is_measured) return frame;  // without pixels, as the orientation is unknown
  frame.range_m = row.range_m;
  frame.px = row.px;
  frame.starts_segment = !has_last_;
  if (source_ == RotationSource::rate) advance_by_rate(row.rate_rad_per_s, frame);
  if (attitude) advance_by_attitude(*attitude, frame);
  advance_shift(row.velocity_m_per_s, frame);
  frame.cam_from_start = cam_from_start_;
  frame.shift_m = shift_m_;
  last_t_s_ = row.t_s;
  has_last_ = true;
  return frame;
}

std::optional<Eigen::Quaterniond> MotionReader::attitude_of(const RotationRow& row) const {
  if (source_ == RotationSource::head && row.pan_tilt_roll_rad.allFinite())
    return base_from_cam_rotation(row.pan_tilt_roll_rad);
  if (source_ == RotationSource::attitude && row.base_from_cam.squaredNorm() > 0.25) return row.base_from_cam;
  return std::nullopt;
}

void MotionReader::advance_by_rate(const Eigen::Vector3d& rate, RotationFrame& frame) {
  frame.rate_rad_per_s = rate;
  if (!has_last_ || frame.dt_s > max_gap_s_) {
    frame.starts_segment = true;
    has_before_ = false;
    last_rate_ = rate;
    return;
  }
  if (!(frame.dt_s > 0.0)) return;
  const double h = frame.dt_s;
  const Eigen::Vector3d turn = has_before_ ? integral(before_rate_, last_rate_, rate, last_dt_s_, h)
                                           : Eigen::Vector3d(0.5 * h * (last_rate_ + rate));
  // With the second term of the Magnus series: R = Exp(−(turn − h²/12 ω₁ × ω₀)).
  const Eigen::Vector3d vector = turn - h * h / 12.0 * rate.cross(last_rate_);
  cam_from_start_ = (exp_so3(-vector) * cam_from_start_).normalized();
  frame.mean_rate_rad_per_s = vector / h;
  frame.acceleration_rad_per_s2 = (rate - last_rate_) / h;
  before_rate_ = last_rate_;
  last_rate_ = rate;
  last_dt_s_ = h;
  has_before_ = true;
}

void MotionReader::advance_by_attitude(const Eigen::Quaterniond& base_from_cam, RotationFrame& frame) {
  if (has_last_) {
    const Eigen::Quaterniond now_from_last = base_from_cam.conjugate() * last_base_from_cam_;
    cam_from_start_ = (now_from_last * cam_from_start_).normalized();
    if (frame.dt_s > 0.0) frame.mean_rate_rad_per_s = -log_so3(now_from_last.normalized()) / frame.dt_s;
    // Over a longer gap it may have stopped, or rotated back and forth: the rates at its ends are unknown.
    const bool is_far = frame.dt_s > max_gap_s_;
    if (has_before_ && frame.dt_s > 0.0 && last_dt_s_ > 0.0 && !is_far && last_dt_s_ <= max_gap_s_) {
      const Eigen::Vector3d change = frame.mean_rate_rad_per_s - last_mean_rate_;
      frame.acceleration_rad_per_s2 = 2.0 * change / (frame.dt_s + last_dt_s_);
    }
    frame.rate_rad_per_s =
        is_far ? Eigen::Vector3d::Zero()
               : Eigen::Vector3d(frame.mean_rate_rad_per_s + 0.5 * frame.dt_s * frame.acceleration_rad_per_s2);
    last_mean_rate_ = frame.mean_rate_rad_per_s;
    last_dt_s_ = frame.dt_s;
    has_before_ = true;
  }
  last_base_from_cam_ = base_from_cam;
}

/// ṁ = −v − ω × m, with the mean of v over the step: the earlier shift rotates with the camera.
void MotionReader::advance_shift(const Eigen::Vector3d& velocity, const RotationFrame& frame) {
  if (frame.starts_segment) {
    cam_from_start_.setIdentity();
    shift_m_.setZero();
  } else {
    const Eigen::Vector3d turn = frame.mean_rate_rad_per_s * frame.dt_s;
    const Eigen::Vector3d moved = 0.5 * frame.dt_s * (last_velocity_ + velocity);
    shift_m_ = exp_so3(-turn) * shift_m_ - exp_so3(-0.5 * turn) * moved;
  }
  last_velocity_ = velocity;
}

void take_central_rates(double max_gap_s, std::span<RotationFrame> frames) {
  constexpr std::size_t reach = 2;
  const auto mean_rate = [&](std::size_t from, std::size_t until) -> Eigen::Vector3d {
    const double elapsed_s = frames[until].t_s - frames[from].t_s;
    if (!(elapsed_s > 0.0)) return Eigen::Vector3d::Zero();
    const Eigen::Quaterniond turn = frames[until].cam_from_start * frames[from].cam_from_start.conjugate();
    return -log_so3(turn.normalized()) / elapsed_s;
  };
  for (std::size_t k = 0; k < frames.size(); ++k) {
    const std::size_t before = k - std::min(k, reach), after = std::min(k + reach, frames.size() - 1);
    const double elapsed_s = frames[after].t_s - frames[before].t_s;
    frames[k].rate_rad_per_s.setZero();
    frames[k].acceleration_rad_per_s2.setZero();
    if (!(elapsed_s > 0.0) || elapsed_s > 2.0 * max_gap_s) continue;
    frames[k].rate_rad_per_s = mean_rate(before, after);
    if (before < k && k < after)
      frames[k].acceleration_rad_per_s2 = 2.0 * (mean_rate(k, after) - mean_rate(before, k)) / elapsed_s;
  }
}

}  // namespace alidade
