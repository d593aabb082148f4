#include "alidade/fleet/fleet_tracking.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double allowance = 1.0;       // of the sums, σ: half the change that they find fastest
constexpr double max_per_row = 4.0;     // σ: an outlier row alone is no change
constexpr int learning_rows = 5;        // of a change, before it is reported
constexpr double largest_change = 0.5;  // rad, or relative: more is another camera
constexpr double drift_prior = 2e-4;    // σ of f per °C before it is known: metal and glass have 10⁻⁵ to 10⁻⁴
constexpr double rate_walk = 1e-4;      // of the zeros of a camera whose rates are measured: rad in a second

using Channels = Eigen::Matrix<double, num_fleet_channels, 1>;
using ChannelMatrix = Eigen::Matrix<double, num_fleet_channels, num_fleet_channels>;

using Upper = decltype(FleetTracking::P);

FleetCommonMatrix matrix_of(const Upper& upper) {
  FleetCommonMatrix P;
  std::size_t at = 0;
  for (Eigen::Index i = 0; i < num_fleet_common; ++i)
    for (Eigen::Index j = i; j < num_fleet_common; ++j) P(i, j) = P(j, i) = upper[at++];
  return P;
}

void store(const FleetCommonMatrix& P, Upper& upper) {
  std::size_t at = 0;
  for (Eigen::Index i = 0; i < num_fleet_common; ++i)
    for (Eigen::Index j = i; j < num_fleet_common; ++j) upper[at++] = 0.5 * (P(i, j) + P(j, i));
}

using Slope = Eigen::Map<Eigen::Matrix<double, 2, num_fleet_common, Eigen::RowMajor>>;

/// What a row says of a point, given the shared parameters.
struct Seen {
  std::size_t point = 0;
  Eigen::Vector2d innovation;
  Eigen::Matrix2d J;  ///< Over (a, b).
  FleetPixelByCommon G;
  Eigen::Matrix<double, 2, num_fleet_channels> H;  ///< Of a change of each channel.
  Eigen::Matrix2d R_inverse, C;
};

/// A row's innovations together.
struct Innovations {
  std::array<Seen, max_fleet_points> seen;
  std::size_t num = 0;
  FleetCommonMatrix after;  ///< P once they are taken in.
  FleetCommon step;
  double nis = 0.0;
  Channels score = Channels::Zero();
  ChannelMatrix information = ChannelMatrix::Zero();
};

/// A point that is somewhere else, where most points fit: no change of the camera. Where most do not, it may be one.
void leave_out_strays(const FleetCommonMatrix& P, Innovations& all) {
  constexpr double fits = 30.0, strays = 60.0;  // χ² of two degrees of freedom: 3·10⁻⁷, 10⁻¹³
  std::array<double, max_fleet_points> own{};
  std::size_t num_fit = 0;
  for (std::size_t i = 0; i < all.num; ++i) {
    const Seen& seen = all.seen[i];
    const Eigen::Matrix2d S = seen.R_inverse.inverse() + seen.G * P * seen.G.transpose();
    own[i] = seen.innovation.dot(S.inverse() * seen.innovation);
    num_fit += own[i] < fits ? 1 : 0;
  }
  if (2 * num_fit < all.num) return;
  std::size_t kept = 0;
  for (std::size_t i = 0; i < all.num; ++i)
    if (own[i] < strays) all.seen[kept++] = all.seen[i];
  all.num = kept;
}

/// Each point that is seen, against where it is expected.
void see_points(FleetCamera& camera, const FleetRow& row, const FleetView& view, const FleetCommon& x,
                Innovations& all) {
  const double variance = camera.sigma_px * camera.sigma_px;
  for (std::size_t k = 0; k < camera.num_points; ++k) {
    const Eigen::Vector2d px(row.px[2 * k], row.px[2 * k + 1]);
    if ((camera.known_points >> k & 1U) == 0 || !std::isfinite(px.x()) || !std::isfinite(px.y())) continue;
    FleetPoint& point = camera.body.tracking.points[k];
    const Eigen::Vector3d e(point.direction.data());
    const auto basis = basis_beside(e);
    const FleetPrediction at = view.predict(e + basis * Eigen::Vector2d(point.ab.data()));
    if (!at.is_seen) continue;
    Seen& seen = all.seen[all.num++];
    seen.point = k;
    seen.innovation = px - at.px;
    seen.J = at.by_ray * basis;
    seen.G = at.by_common + seen.J * Slope(point.slope.data());
    seen.H.col(0) = at.by_common.col(4);
    seen.H.col(1) = at.by_common.col(5);
    seen.H.col(2) = x[0] * at.by_common.col(0) + x[1] * at.by_common.col(1);
    seen.C << point.cov[0], point.cov[1], point.cov[1], point.cov[2];
    seen.R_inverse = (variance * Eigen::Matrix2d::Identity() + seen.J * seen.C * seen.J.transpose()).inverse();
  }
}

Innovations innovations_of(FleetCamera& camera, const FleetRow& row, const FleetView& view, const FleetCommon& x,
                           const FleetCommonMatrix& P) {
  Innovations all;
  see_points(camera, row, view, x, all);
  leave_out_strays(P, all);
  FleetCommonMatrix information = FleetCommonMatrix::Zero();
  FleetCommon gradient = FleetCommon::Zero();
  Eigen::Matrix<double, num_fleet_channels, num_fleet_common> W;
  W.setZero();
  double squares = 0.0;
  for (std::size_t i = 0; i < all.num; ++i) {
    const Seen& seen = all.seen[i];
    const FleetPixelByCommon weighted = seen.R_inverse * seen.G;
    const Eigen::Vector2d whitened = seen.R_inverse * seen.innovation;
    information.noalias() += seen.G.transpose() * weighted;
    gradient.noalias() += seen.G.transpose() * whitened;
    squares += seen.innovation.dot(whitened);
    W.noalias() += seen.H.transpose() * weighted;
    all.score.noalias() += seen.H.transpose() * whitened;
    all.information.noalias() += seen.H.transpose() * seen.R_inverse * seen.H;
  }
  // (P⁻¹ + Λ)⁻¹ where P may be singular: the zeros are exact until they have moved.
  all.after = (FleetCommonMatrix::Identity() + P * information).partialPivLu().solve(P);
  all.step = all.after * gradient;
  all.nis = squares - gradient.dot(all.step);
  all.score -= W * all.step;
  all.information -= W * all.after * W.transpose();
  return all;
}

void take_in(const Innovations& all, FleetTracking& tracking) {
  for (std::size_t k = 0; k < num_fleet_common; ++k) tracking.x[k] += all.step[static_cast<Eigen::Index>(k)];
  std::array<bool, max_fleet_points> is_seen{};
  for (std::size_t i = 0; i < all.num; ++i) {
    const Seen& seen = all.seen[i];
    FleetPoint& point = tracking.points[seen.point];
    is_seen[seen.point] = true;
    Slope slope(point.slope.data());
    const Eigen::Matrix2d gain = seen.C * seen.J.transpose() * seen.R_inverse;
    const Eigen::Vector2d move = slope * all.step + gain * (seen.innovation - seen.G * all.step);
    slope -= (gain * seen.G).eval();
    const Eigen::Matrix2d C = seen.C - gain * seen.J * seen.C;
    point.ab = {point.ab[0] + move.x(), point.ab[1] + move.y()};
    point.cov = {C(0, 0), 0.5 * (C(0, 1) + C(1, 0)), C(1, 1)};
  }
  for (std::size_t k = 0; k < max_fleet_points; ++k) {
    if (is_seen[k]) continue;
    const Eigen::Vector2d move = Slope(tracking.points[k].slope.data()) * all.step;
    tracking.points[k].ab = {tracking.points[k].ab[0] + move.x(), tracking.points[k].ab[1] + move.y()};
  }
  store(all.after, tracking.P);
}

/// The shared parameters walk by so much. The joint normal is projected on the nearest arrowhead, as ArrowheadFilter
/// does it; what was exact before has no part in it.
void walk(const FleetCommon& variance, FleetTracking& tracking) {
  const FleetCommonMatrix P = matrix_of(tracking.P);
  FleetCommonMatrix walked = P;
  walked.diagonal() += variance;
  FleetCommonMatrix regular = walked;
  FleetCommon scale;
  for (Eigen::Index i = 0; i < num_fleet_common; ++i) {
    if (!(regular(i, i) > 0.0)) regular(i, i) = 1.0;  // its row and column are zero
    scale[i] = 1.0 / std::sqrt(regular(i, i));
  }
  const FleetCommonMatrix inverse =
      scale.asDiagonal() *
      FleetCommonMatrix(FleetCommonMatrix(scale.asDiagonal() * regular * scale.asDiagonal()).inverse()) *
      scale.asDiagonal();
  const FleetCommonMatrix gain = P * inverse, lost = P - gain * walked * gain.transpose();
  for (FleetPoint& point : tracking.points) {
    Slope slope(point.slope.data());
    const Eigen::Matrix2d more = slope * lost * slope.transpose();
    point.cov = {point.cov[0] + more(0, 0), point.cov[1] + more(0, 1), point.cov[2] + more(1, 1)};
    slope = (slope * gain).eval();
  }
  store(walked, tracking.P);
}

/// σ² of the innovations over the estimated one, at least: conservative while few rows have contributed.
double noise_factor(const FleetCamera& camera) {
  constexpr double prior_dof = 100.0;  // about that of the initial rows
  const double dof = camera.sum_dof + prior_dof;
  return (camera.sum_nis + prior_dof + 2.0 * std::sqrt(2.0 * dof)) / dof;
}

double gate_of(double dof) { return dof + 4.5 * std::sqrt(2.0 * dof) + 12.0; }

std::size_t common_of(FleetAlarmKind kind) {
  if (kind == FleetAlarmKind::focal_length) return 0;
  return kind == FleetAlarmKind::pan_zero ? 4 : 5;
}

double variance_of(const FleetTracking& tracking, std::size_t i) {
  std::size_t at = 0;
  for (std::size_t k = 0; k < i; ++k) at += num_fleet_common - k;
  return tracking.P[at];
}

/// The change that a sum indicates is accepted with a wide σ, and estimated from the following rows.
void begin_change(int sum_index, FleetTracking& tracking) {
  const FleetSum& sum = tracking.sums[static_cast<std::size_t>(sum_index)];
  const double value = sum.score / sum.information, wide = 3.0 / std::sqrt(sum.information) + std::abs(value);
  FleetChange& change = tracking.change;
  change.kind = static_cast<FleetAlarmKind>(sum_index / 2 + 1);
  const std::size_t at = common_of(change.kind);
  change.rows_left = learning_rows;
  change.x_before = tracking.x[at];
  change.variance_before = variance_of(tracking, at);
  change.since_s = sum.since_s;
  FleetCommon variance = FleetCommon::Zero();
  if (at == 0) {
    for (std::size_t i = 0; i < 2; ++i) {
      variance[static_cast<Eigen::Index>(i)] = std::pow(wide * tracking.x[i], 2);
      tracking.x[i] *= std::clamp(1.0 + value, 0.2, 5.0);
    }
  } else {
    variance[static_cast<Eigen::Index>(at)] = wide * wide;
    tracking.x[at] += value;
  }
  walk(variance, tracking);
  tracking.sums = {};
}

/// The change as estimated from the rows since. σ is of the change alone: earlier uncertainty is in neither.
FleetAlarm learned_change(const FleetCamera& camera, const FleetRow& row) {
  const FleetTracking& tracking = camera.body.tracking;
  const FleetChange& change = tracking.change;
  const std::size_t at = common_of(change.kind);
  const double after = variance_of(tracking, at);
  const double scale = change.kind == FleetAlarmKind::focal_length ? 1.0 / change.x_before : 1.0;
  FleetAlarm alarm{change.kind, row.n, row.t_s, 0.0, 0.0, change.since_s};
  alarm.value = scale * (tracking.x[at] - change.x_before);
  alarm.sigma = scale * std::sqrt(noise_factor(camera) * std::max(after - change.variance_before, 0.05 * after));
  return alarm;
}

/// By how much a row is warmer than where fx and fy are known; from the first row on that has a temperature the change
/// with it is estimated. [°C]
double warmer_by(FleetCamera& camera, const FleetRow& row) {
  FleetTracking& tracking = camera.body.tracking;
  const double now_c = std::isfinite(row.temperature_c) ? row.temperature_c : static_cast<double>(camera.temperature_c);
  if (!std::isfinite(now_c)) return 0.0;
  if (std::isnan(tracking.reference_c)) {
    tracking.reference_c = static_cast<float>(now_c);
    tracking.P.back() = drift_prior * drift_prior;
  }
  return now_c - static_cast<double>(tracking.reference_c);
}

/// Whether the focal length follows the temperature, reported once: by how much likelier the rows are with a drift of
/// the prior's size than without one. Where there is none, that exceeds B once in B cameras, however long they are
/// watched (J. Ville, "Étude critique de la notion de collectif", 1939).
std::optional<FleetAlarm> drift_of(FleetCamera& camera, const FleetRow& row) {
  const double log_of_once_in = std::log(1e7);
  FleetTracking& tracking = camera.body.tracking;
  const double variance = tracking.P.back(), drift = tracking.x.back();
  if (tracking.has_said_drift != 0 || !(variance > 0.0)) return std::nullopt;
  const double factor = noise_factor(camera);
  const double log_likelier =
      0.5 * drift * drift / (factor * variance) + 0.5 * std::log(variance / (drift_prior * drift_prior));
  if (!(log_likelier > log_of_once_in)) return std::nullopt;
  tracking.has_said_drift = 1;
  return FleetAlarm{FleetAlarmKind::focal_temperature, row.n, row.t_s, drift, std::sqrt(factor * variance), row.t_s};
}

/// Where a single row alone identifies the changed channel, that one's sum: several may exceed the threshold at once.
int clearest_of(const Innovations& all, const FleetSums& sums, double threshold, int found) {
  constexpr double clear = 6.0;
  const ChannelMatrix cov = all.information.inverse();
  const Channels change = cov * all.score;
  double best = clear;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const auto at = static_cast<Eigen::Index>(i / 2);
    const double z = (i % 2 == 0 ? 1.0 : -1.0) * change[at] / std::sqrt(cov(at, at));
    if (!(sums[i].sum > threshold - max_per_row) || !(z > best)) continue;  // beyond it by the next row
    best = z;
    found = static_cast<int>(i);
  }
  return found;
}

}  // namespace

int add_scores(FleetSums& sums, const FleetScores& row, double noise_factor, double t_s, double threshold) {
  int found = -1;
  double clearest = 0.0;
  for (std::size_t i = 0; i < sums.size(); ++i) {
    const std::size_t channel = i / 2;
    if (!(row.information[channel] > 0.0)) continue;
    const double u = row.score[channel] / std::sqrt(noise_factor * row.information[channel]);
    FleetSum& sum = sums[i];
    if (sum.sum == 0.0) sum = {0.0, 0.0, 0.0, t_s};
    const double along = std::clamp(i % 2 == 0 ? u : -u, -max_per_row, max_per_row);
    sum.sum = std::max(0.0, sum.sum + along - allowance);
    sum.score += row.score[channel];
    sum.information += row.information[channel];
    if (!(sum.sum > threshold)) continue;
    const double z = std::abs(sum.score) / std::sqrt(sum.information);
    if (found >= 0 && !(z > clearest)) continue;
    found = static_cast<int>(i);
    clearest = z;
  }
  return found;
}

namespace {

/// Whether the sums of a row's scores have found a change, which is learned from the next row on. One that is too large
/// to be one loses the camera.
bool finds_change(const Innovations& all, const FleetConfig& config, double factor, double t_s, FleetCamera& camera) {
  FleetTracking& tracking = camera.body.tracking;
  const bool has_angles = camera.source != FleetSource::rate;
  FleetScores scores;
  for (std::size_t i = has_angles ? 0 : 2; i < num_fleet_channels; ++i) {
    const auto at = static_cast<Eigen::Index>(i);
    scores.score[i] = all.score[at];
    scores.information[i] = all.information(at, at);
  }
  const int found = add_scores(tracking.sums, scores, factor, t_s, config.threshold);
  if (found < 0) return false;
  const int clearest = clearest_of(all, tracking.sums, config.threshold, found);
  const FleetSum& sum = tracking.sums[static_cast<std::size_t>(clearest)];
  const bool is_possible = std::abs(sum.score / sum.information) < largest_change;
  camera.num_gated = is_possible ? 0 : lost_rows;
  if (is_possible) begin_change(clearest, tracking);
  return true;
}

}  // namespace

std::optional<FleetAlarm> track_row(FleetCamera& camera, const FleetRow& row, const FleetRotation& rotation,
                                    const FleetConfig& config) {
  FleetTracking& tracking = camera.body.tracking;
  if (camera.source == FleetSource::rate) {
    FleetCommon variance = FleetCommon::Zero();
    variance.segment<2>(4).setConstant(rate_walk * rate_walk * std::max(0.0, row.t_s - camera.t_s));
    walk(variance, tracking);
  }
  const FleetCommon x(tracking.x.data());
  const FleetView view(rotation, x, warmer_by(camera, row));
  const Innovations all = innovations_of(camera, row, view, x, matrix_of(tracking.P));
  if (all.num == 0) return std::nullopt;
  const double factor = noise_factor(camera), dof = 2.0 * static_cast<double>(all.num);
  const bool is_learning = tracking.change.rows_left > 0;
  if (!is_learning && finds_change(all, config, factor, row.t_s, camera))
    return std::nullopt;  // this row has been used already
  const bool fits = all.nis <= factor * gate_of(dof);
  if (fits) {
    camera.num_gated = 0;
    camera.sum_nis += all.nis;
    camera.sum_dof += dof;
    take_in(all, tracking);
  } else if (camera.num_gated < 60000) {
    ++camera.num_gated;
  }
  if (!is_learning) return drift_of(camera, row);
  if (--tracking.change.rows_left > 0) return std::nullopt;
  if (camera.num_gated >= learning_rows) {  // none of them fits: it was no such change
    camera.num_gated = lost_rows;
    return std::nullopt;
  }
  return learned_change(camera, row);
}

}  // namespace alidade
