#include "alidade/tables/logs/angle_interpolation.h"

#include <algorithm>
#include <cmath>

#include "alidade/geometry/so3.h"
#include "alidade/pantilt/head_view.h"

namespace alidade {
namespace {

constexpr double same_row_s = 1e-6;  // less than a shutter's jitter; more than a file's last digit

/// Adds whole turns so that no step is longer than half of one.
void unwrap(std::vector<RotationRow>& rows) {
  Eigen::Vector3d last = Eigen::Vector3d::Constant(not_seen);
  for (RotationRow& row : rows) {
    Eigen::Vector3d& angles = row.pan_tilt_roll_rad;
    if (!angles.allFinite()) continue;
    if (last.allFinite())
      for (int i = 0; i < 3; ++i) angles[i] = angle_near(angles[i], last[i]);
    last = angles;
  }
}

}  // namespace

AngleInterpolation::AngleInterpolation(const RotationLog& angles) : source_(angles.source) {
  for (std::size_t i = 0; i < angles.rows.size(); ++i) {
    if (!rows_.empty() && angles.rows[i].t_s - rows_.back().t_s < same_row_s) continue;
    rows_.push_back(angles.rows[i]);
    rows_.back().px.clear();
    if (!angles.truth.empty()) truth_.push_back(angles.truth[i]);
  }
  unwrap(rows_);
}

bool AngleInterpolation::covers(double t_s) const {
  return t_s >= first_s() - same_row_s && t_s <= last_s() + same_row_s;
}

std::size_t AngleInterpolation::interval_of(double t_s) const {
  const auto after =
      std::upper_bound(rows_.begin(), rows_.end(), t_s, [](double t, const RotationRow& row) { return t < row.t_s; });
  const auto next = static_cast<std::size_t>(after - rows_.begin());
  return std::min(next > 0 ? next - 1 : 0, rows_.size() >= 2 ? rows_.size() - 2 : 0);
}

/// Three values that change smoothly: for attitudes the rotation since the reference row.
Eigen::Vector3d AngleInterpolation::value(std::size_t row, std::size_t reference) const {
  if (source_ == RotationSource::rate) return rows_[row].rate_rad_per_s;
  if (source_ == RotationSource::head) return rows_[row].pan_tilt_roll_rad;
  const Eigen::Quaterniond &from = rows_[reference].base_from_cam, &to = rows_[row].base_from_cam;
  if (!(from.squaredNorm() > 0.25 && to.squaredNorm() > 0.25)) return Eigen::Vector3d::Constant(not_seen);
  const Eigen::Quaterniond turn = from.conjugate() * to;
  return log_so3(turn);
}

/// Derivative at a row of the parabola through it and its neighbours; at an end or beside a gap that of the chord.
Eigen::Vector3d AngleInterpolation::slope(std::size_t row, std::size_t reference) const {
  const auto chord = [&](std::size_t i) {
    const Eigen::Vector3d step = value(i + 1, reference) - value(i, reference);
    return Eigen::Vector3d(step / (rows_[i + 1].t_s - rows_[i].t_s));
  };
  const Eigen::Vector3d none = Eigen::Vector3d::Constant(not_seen);
  const Eigen::Vector3d before = row > 0 ? chord(row - 1) : none, after = row + 1 < rows_.size() ? chord(row) : none;
  if (!before.allFinite()) return after;
  if (!after.allFinite()) return before;
  const double h0 = rows_[row].t_s - rows_[row - 1].t_s, h1 = rows_[row + 1].t_s - rows_[row].t_s;
  return (h1 * before + h0 * after) / (h0 + h1);
}

RotationRow AngleInterpolation::at(double t_s) const {
  const std::size_t i = interval_of(t_s);
  for (const std::size_t row : {i, std::min(i + 1, rows_.size() - 1)}) {
    if (std::abs(rows_[row].t_s - t_s) > same_row_s) continue;
    RotationRow same = rows_[row];
    same.t_s = t_s;
    return same;
  }
  const double h = rows_[i + 1].t_s - rows_[i].t_s, s = (t_s - rows_[i].t_s) / h;
  const Eigen::Vector3d y0 = value(i, i), y1 = value(i + 1, i), d0 = slope(i, i), d1 = slope(i + 1, i);
  const Eigen::Vector3d now = y0 + s * s * (3.0 - 2.0 * s) * (y1 - y0) + h * s * (1.0 - s) * ((1.0 - s) * d0 - s * d1);
  RotationRow row;
  row.t_s = t_s;
  row.velocity_m_per_s = (1.0 - s) * rows_[i].velocity_m_per_s + s * rows_[i + 1].velocity_m_per_s;
  if (source_ == RotationSource::rate) row.rate_rad_per_s = now;
  if (source_ == RotationSource::head) row.pan_tilt_roll_rad = now;
  if (source_ == RotationSource::attitude && now.allFinite()) row.base_from_cam = rows_[i].base_from_cam * exp_so3(now);
  return row;
}

TrueIntrinsics AngleInterpolation::truth_at(double t_s) const {
  const std::size_t i = interval_of(t_s), next = std::min(i + 1, truth_.size() - 1);
  const double h = rows_[next].t_s - rows_[i].t_s;
  const double s = h > 0.0 ? std::clamp((t_s - rows_[i].t_s) / h, 0.0, 1.0) : 0.0;
  TrueIntrinsics truth = truth_[i];
  for (std::size_t k = 0; k < truth.size(); ++k) truth[k] += s * (truth_[next][k] - truth_[i][k]);
  return truth;
}

std::vector<RotationRow> AngleInterpolation::between(double begin_s, double end_s) const {
  std::vector<RotationRow> inside;
  for (std::size_t i = interval_of(begin_s); i < rows_.size() && rows_[i].t_s < end_s - same_row_s; ++i)
    if (rows_[i].t_s > begin_s + same_row_s) inside.push_back(rows_[i]);
  return inside;
}

}  // namespace alidade
