#include "alidade/pantilt/positioner.h"

#include <cmath>
#include <numbers>
#include <utility>

namespace alidade {

Resonance::Resonance(const Mode& mode, const DriveMotion& drive)
    : omega_(2.0 * std::numbers::pi * mode.hz),
      damping_(mode.damping),
      damped_omega_(omega_ * std::sqrt(1.0 - mode.damping * mode.damping)),
      angle_(drive.angle_rad - 2.0 * mode.damping / omega_ * drive.rate_rad_s),
      rate_(drive.rate_rad_s) {}

const Resonance::Swing& Resonance::swing_over(double dt_s) {
  constexpr double rounding_s = 1e-12;
  for (const Swing& known : known_)
    if (std::abs(known.dt_s - dt_s) < rounding_s) return known;
  std::swap(known_[0], known_[1]);
  const double turned = damped_omega_ * dt_s;
  return known_[0] = {dt_s, std::exp(-damping_ * omega_ * dt_s), std::cos(turned), std::sin(turned)};
}

void Resonance::advance(double dt_s, const DriveMotion& from, const DriveMotion& to) {
  if (!(dt_s > 0.0)) return;
  // The drive from + a₁t + a₂t² + a₃t³, and what follows it for ever: b₀ + b₁t + b₂t² + b₃t³.
  const double mean = (to.angle_rad - from.angle_rad) / dt_s, a1 = from.rate_rad_s;
  const double a2 = (3.0 * mean - 2.0 * a1 - to.rate_rad_s) / dt_s;
  const double a3 = (a1 + to.rate_rad_s - 2.0 * mean) / (dt_s * dt_s);
  const double late = 2.0 * damping_ / omega_, bend = 1.0 / (omega_ * omega_);
  const double b3 = a3, b2 = a2 - 3.0 * late * b3, b1 = a1 - 2.0 * late * b2 - 6.0 * bend * b3;
  const double b0 = from.angle_rad - late * b1 - 2.0 * bend * b2;
  const double off = angle_ - b0, off_rate = rate_ - b1;
  const Swing& swing = swing_over(dt_s);
  const double side = swing.sine / damped_omega_, drag = damping_ * omega_;
  angle_ =
      b0 + dt_s * (b1 + dt_s * (b2 + dt_s * b3)) + swing.decay * (swing.cosine * off + side * (off_rate + drag * off));
  rate_ = b1 + dt_s * (2.0 * b2 + 3.0 * dt_s * b3) +
          swing.decay * (swing.cosine * off_rate - side * (omega_ * omega_ * off + drag * off_rate));
}

}  // namespace alidade
