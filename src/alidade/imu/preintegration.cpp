#include "alidade/imu/preintegration.h"

#include <algorithm>
#include <utility>
#include <vector>

#include "alidade/estimation/median.h"
#include "alidade/geometry/so3_jacobian.h"

namespace alidade {
namespace {

ImuReading between(const ImuReading& a, const ImuReading& b, double t_s) {
  const double gap_s = b.t_s - a.t_s, share = gap_s > 0.0 ? (t_s - a.t_s) / gap_s : 0.0;
  return {t_s, (1.0 - share) * a.rate_rad_s + share * b.rate_rad_s,
          (1.0 - share) * a.force_m_s2 + share * b.force_m_s2};
}

/// Integrates from one reading to the next, with the mean of both: the force is rotated by half of the rotation.
void integrate(const ImuReading& a, const ImuReading& b, const Eigen::Vector3d& rate_bias,
               const Eigen::Vector3d& force_bias, ImuStep& step) {
  const double h = b.t_s - a.t_s;
  const Eigen::Vector3d phi = h * (0.5 * (a.rate_rad_s + b.rate_rad_s) - rate_bias);
  const Eigen::Vector3d force = 0.5 * (a.force_m_s2 + b.force_m_s2) - force_bias;
  const Eigen::Vector3d half = 0.5 * phi;
  const Eigen::Quaterniond by_half = exp_so3(half);
  const Eigen::Matrix3d R = (step.rotation * by_half).toRotationMatrix();
  const Eigen::Matrix3d J_half =
      by_half.toRotationMatrix().transpose() * step.rotation_by_rate - 0.5 * h * right_jacobian(half);
  const Eigen::Matrix3d by_rate = -R * cross_matrix(force) * J_half;
  step.position += h * step.velocity + 0.5 * h * h * (R * force);
  step.position_by_rate += h * step.velocity_by_rate + 0.5 * h * h * by_rate;
  step.position_by_force += h * step.velocity_by_force - 0.5 * h * h * R;
  step.velocity += h * (R * force);
  step.velocity_by_rate += h * by_rate;
  step.velocity_by_force -= h * R;
  const Eigen::Quaterniond turn = exp_so3(phi);
  step.rotation_by_rate = turn.toRotationMatrix().transpose() * step.rotation_by_rate - h * right_jacobian(phi);
  step.rotation = (step.rotation * turn).normalized();
  step.dt_s += h;
}

}  // namespace

std::optional<ImuReading> reading_at(std::span<const ImuReading> readings, double t_s) {
  const auto after = std::ranges::lower_bound(readings, t_s, {}, &ImuReading::t_s);
  if (after == readings.end()) return std::nullopt;
  if (after->t_s == t_s) return *after;
  if (after == readings.begin()) return std::nullopt;
  return between(*(after - 1), *after, t_s);
}

double usual_period_s(std::span<const ImuReading> readings) {
  std::vector<double> periods;
  for (std::size_t i = 1; i < readings.size(); ++i) periods.push_back(readings[i].t_s - readings[i - 1].t_s);
  return median_of(std::move(periods));
}

std::optional<ImuStep> preintegrated(std::span<const ImuReading> readings, double from_s, double to_s, double max_gap_s,
                                     const Eigen::Vector3d& rate_bias, const Eigen::Vector3d& force_bias) {
  const auto first = reading_at(readings, from_s), last = reading_at(readings, to_s);
  if (!first || !last || !(to_s > from_s)) return std::nullopt;
  auto next = std::ranges::upper_bound(readings, from_s, {}, &ImuReading::t_s);
  if (next != readings.begin() && next != readings.end() && next->t_s - (next - 1)->t_s > max_gap_s)
    return std::nullopt;
  ImuStep step;
  ImuReading before = *first;
  for (; next != readings.end() && next->t_s < to_s; ++next) {
    if (next + 1 != readings.end() && (next + 1)->t_s - next->t_s > max_gap_s) return std::nullopt;
    integrate(before, *next, rate_bias, force_bias, step);
    before = *next;
  }
  integrate(before, *last, rate_bias, force_bias, step);
  const Eigen::Vector3d w = first->rate_rad_s - rate_bias, f = first->force_m_s2 - force_bias;
  const Eigen::Vector3d w_last = last->rate_rad_s - rate_bias, f_last = last->force_m_s2 - force_bias;
  step.rotation_by_time = w_last - step.rotation.conjugate() * w;
  step.velocity_by_time = step.rotation * f_last - f - w.cross(step.velocity);
  step.position_by_time = step.velocity - step.dt_s * f - w.cross(step.position);
  return step;
}

std::vector<ImuReading> without_frozen(std::vector<ImuReading> readings) {
  constexpr std::size_t min_equal = 10;
  constexpr double min_s = 0.1;
  std::vector<ImuReading> kept;
  for (std::size_t i = 0; i < readings.size();) {
    std::size_t end = i + 1;
    while (end < readings.size() && readings[end].rate_rad_s == readings[i].rate_rad_s &&
           readings[end].force_m_s2 == readings[i].force_m_s2)
      ++end;
    const bool is_frozen = end - i >= min_equal && readings[end - 1].t_s - readings[i].t_s >= min_s;
    const auto from = readings.begin() + static_cast<std::ptrdiff_t>(i);
    kept.insert(kept.end(), from, is_frozen ? from + 1 : readings.begin() + static_cast<std::ptrdiff_t>(end));
    i = end;
  }
  return kept;
}

}  // namespace alidade
