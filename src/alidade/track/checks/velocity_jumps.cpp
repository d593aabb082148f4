#include <Eigen/LU>
#include <algorithm>
#include <string>

#include "alidade/geometry/decompositions.h"
#include "alidade/track/checks/explanation.h"

namespace alidade {
namespace {

/// Position, velocity and their covariance of a target that is moved only by gravity, at `dt_s` later or earlier.
Belief<6> continued(const Belief<6>& belief, double dt_s, const Eigen::Vector3d& gravity_m_s2) {
  Eigen::Matrix<double, 6, 6> F = Eigen::Matrix<double, 6, 6>::Identity();
  F.topRightCorner<3, 3>().diagonal().setConstant(dt_s);
  Belief<6> result{F * belief.x, F * belief.P * F.transpose()};
  result.x.head<3>() += 0.5 * dt_s * dt_s * gravity_m_s2;
  result.x.tail<3>() += dt_s * gravity_m_s2;
  return result;
}

/// The last accepted step before the track restarted at `restart`, and the first one after which the velocity is
/// known.
struct Sides {
  const TrackStep *before = nullptr, *after = nullptr;
};

Sides sides_of(std::span<const TrackStep> steps, std::size_t restart) {
  constexpr double settled_s = 0.15;
  Sides sides;
  for (std::size_t i = restart; i-- > 0 && sides.before == nullptr;)
    if (steps[i].accepted && steps[i].has_belief) sides.before = &steps[i];
  for (std::size_t i = restart + 1; i < steps.size() && steps[i].event != TrackEvent::restart; ++i) {
    if (!steps[i].accepted || steps[i].t_s < steps[restart].t_s + settled_s) continue;
    sides.after = &steps[i];
    break;
  }
  return sides;
}

struct Jump {
  double t_s = 0.0, by_m_s = 0.0;
};

/// The difference of the two paths at one time, with its covariance.
Belief<6> apart_at(const Sides& sides, double t_s, const Eigen::Vector3d& gravity_m_s2) {
  const Belief<6> before = continued(sides.before->belief, t_s - sides.before->t_s, gravity_m_s2);
  const Belief<6> after = continued(sides.after->belief, t_s - sides.after->t_s, gravity_m_s2);
  return {after.x - before.x, before.P + after.P};
}

/// The closest approach of the two paths, in σ of both; none if they do not meet, or meet with the same velocity.
std::optional<Jump> jump_between(const Sides& sides, const Eigen::Vector3d& gravity_m_s2) {
  constexpr int num_steps = 10;
  constexpr double chi2_3_at_999 = 16.27, min_sigma = 4.0;
  double t_s = 0.5 * (sides.before->t_s + sides.after->t_s);
  for (int step = 0; step < num_steps; ++step) {
    const Belief<6> apart = apart_at(sides, t_s, gravity_m_s2);
    const Eigen::Vector3d x = apart.x.head<3>(), v = apart.x.tail<3>();
    const Eigen::Vector3d weighted = solve_symmetric(apart.P.topLeftCorner<3, 3>(), v);
    t_s = std::clamp(t_s - x.dot(weighted) / v.dot(weighted), sides.before->t_s, sides.after->t_s);
  }
  const Belief<6> apart = apart_at(sides, t_s, gravity_m_s2);
  const Eigen::Vector3d x = apart.x.head<3>(), v = apart.x.tail<3>();
  const double distance2 = squared_mahalanobis(x, apart.P.topLeftCorner<3, 3>());
  const double speed2 = squared_mahalanobis(v, apart.P.bottomRightCorner<3, 3>());
  if (!(distance2 < chi2_3_at_999) || !(speed2 > min_sigma * min_sigma)) return std::nullopt;
  return Jump{t_s, v.norm()};
}

}  // namespace

std::optional<VelocityJumps> velocity_jumps(std::span<const TrackStep> steps, const TrackerConfig& config) {
  constexpr double longest_s = 1.0;
  VelocityJumps jumps;
  std::size_t num_restarts = 0;
  for (std::size_t i = 0; i < steps.size(); ++i) {
    if (steps[i].event != TrackEvent::restart) continue;
    ++num_restarts;
    const Sides sides = sides_of(steps, i);
    if (sides.before == nullptr || sides.after == nullptr || sides.after->t_s - sides.before->t_s > longest_s) continue;
    auto jump = jump_between(sides, config.gravity_m_s2);
    if (!jump) jump = jump_between(sides, Eigen::Vector3d::Zero());
    if (!jump) continue;
    if (jumps.num++ == 0) jumps.first_s = jump->t_s, jumps.first_m_s = jump->by_m_s;
  }
  if (jumps.num < 2 || 3 * jumps.num < 2 * num_restarts) return std::nullopt;
  return jumps;
}

Check velocity_jumps_check(const VelocityJumps& jumps) {
  return {"bounces",
          State::care,
          "the target's velocity jumped " + std::to_string(jumps.num) + " times, first at " +
              text_of(jumps.first_s, 3) + " s by " + text_of(jumps.first_m_s, 2) +
              " m/s, as of one that bounces or is struck: positions from there to the new start are off by more than "
              "their σ",
          static_cast<double>(jumps.num),
          0.0,
          "jumps",
          "track"};
}

}  // namespace alidade
