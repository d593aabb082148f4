#include "alidade/track/checks/time_jitter.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

/// An innovation, and the motion of the target in the image.
struct Row {
  Eigen::Vector2d nu, px_per_s;
  Eigen::Matrix2d S;
  double late_s = 0.0, information = 0.0;  ///< Time shift that explains it best, and the information on it.
};

/// For each head in its order, without rejected rows. The motion is that of the belief before the row, which is
/// independent of the row's own innovation.
std::vector<std::vector<Row>> rows_of(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                      std::span<const TrackStep> steps, double gate) {
  std::vector<std::vector<Row>> rows(heads.size());
  const std::size_t num = std::min(observations.size(), steps.size());
  for (std::size_t i = std::max<std::size_t>(1, num / 20); i < num; ++i) {
    const TrackStep &before = steps[i - 1], &step = steps[i];
    const TargetObservation& observation = observations[i];
    if (!step.has_innovation || !before.has_belief || !(step.innovation.nis < gate)) continue;
    const RigHead& head = heads[observation.head];
    const TurnedHead turned(head.head, observation.pan_tilt_rad);
    const auto seen = project_with_jacobians(head.camera, turned.point_in_cam(before.belief.x.head<3>()));
    if (!seen) continue;
    Row row{step.innovation.nu, seen->J_px_point * turned.cam_from_world_rotation * before.belief.x.segment<3>(3),
            step.innovation.S};
    const Eigen::Vector2d weighted = row.S.inverse() * row.px_per_s;
    row.information = weighted.dot(row.px_per_s);
    if (!(row.information > 0.0) || !std::isfinite(row.information)) continue;
    row.late_s = weighted.dot(row.nu) / row.information;
    rows[observation.head].push_back(row);
  }
  return rows;
}

/// Removes what a constant shift of the head's clock explains.
void remove_shift(std::vector<Row>& rows) {
  double pull = 0.0, information = 0.0;
  for (const Row& row : rows) {
    pull += row.information * row.late_s;
    information += row.information;
  }
  if (!(information > 0.0)) return;
  const double shift_s = pull / information;
  for (Row& row : rows) {
    row.late_s -= shift_s;
    row.nu -= shift_s * row.px_per_s;
  }
}

/// ln p of the innovations for times with that variance, and covariances scaled by a factor.
double ln_p(const std::vector<std::vector<Row>>& heads, double variance_s2, double factor) {
  double sum = 0.0;
  for (const std::vector<Row>& rows : heads)
    for (const Row& row : rows) {
      const Eigen::Matrix2d S = factor * row.S + variance_s2 * row.px_per_s * row.px_per_s.transpose();
      sum -= 0.5 * (row.nu.dot(S.inverse() * row.nu) + std::log(S.determinant()));
    }
  return sum;
}

/// The factor that maximises the likelihood of the innovations.
double best_factor(const std::vector<std::vector<Row>>& heads) {
  double nis = 0.0, num = 0.0;
  for (const std::vector<Row>& rows : heads)
    for (const Row& row : rows) {
      nis += row.nu.dot(row.S.inverse() * row.nu);
      num += 2.0;
    }
  return num > 0.0 ? nis / num : 1.0;
}

/// Weighted autocorrelation of the time shifts at a lag of one row.
double autocorrelation(const std::vector<std::vector<Row>>& heads) {
  double lagged = 0.0, power = 0.0;
  for (const std::vector<Row>& rows : heads)
    for (std::size_t k = 1; k < rows.size(); ++k) {
      const double now = rows[k].late_s * std::sqrt(rows[k].information);
      lagged += now * rows[k - 1].late_s * std::sqrt(rows[k - 1].information);
      power += now * now;
    }
  return power > 0.0 ? lagged / power : 0.0;
}

}  // namespace

std::optional<TimeJitter> time_jitter(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                      std::span<const TrackStep> steps, double gate) {
  constexpr double min_gain = 10.0, max_correlation = 0.2, first_ms = 1.0, last_ms = 101.0, finer = 1.19;
  std::vector<std::vector<Row>> rows = rows_of(observations, heads, steps, gate);
  for (std::vector<Row>& of_head : rows) remove_shift(of_head);
  const double factor = best_factor(rows), as_noise = std::max(ln_p(rows, 0.0, 1.0), ln_p(rows, 0.0, factor));
  TimeJitter best;
  double most = as_noise;
  for (double ms = first_ms; ms < last_ms; ms *= finer) {
    const double sum = ln_p(rows, 1e-6 * ms * ms, 1.0);
    if (!(sum > most)) continue;
    most = sum;
    best = {1e-3 * ms, sum - as_noise};
  }
  if (!(best.gain > min_gain) || autocorrelation(rows) > max_correlation) return std::nullopt;
  return best;
}

std::string jitter_text(const TimeJitter& jitter, double step_s) {
  const std::string text = "capture times scatter by " + text_of(1e3 * jitter.sigma_s, 2) +
                           " ms (1σ) about those at which images were taken: innovations grow with the speed of the "
                           "target, to either side";
  return step_s > jitter.sigma_s
             ? text + "; all times are whole steps of " + text_of(1e3 * step_s, 3) + " ms apart, as rounded ones are"
             : text;
}

std::string jitter_remedy() {
  return "write when each image was taken, as its camera stamps it, and not when it arrived or was written";
}

}  // namespace alidade
