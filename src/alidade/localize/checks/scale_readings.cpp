#include "alidade/localize/checks/scale_readings.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

std::optional<Rigid3> pose_at(std::span<const PathStep> path, double t_s) {
  const auto after = std::ranges::lower_bound(path, t_s, {}, &PathStep::t_s);
  if (after == path.end()) return std::nullopt;
  const auto before = after->t_s == t_s || after == path.begin() ? after : after - 1;
  if (before->t_s > t_s || !before->has_pose() || !after->has_pose()) return std::nullopt;
  const double gap_s = after->t_s - before->t_s, share = gap_s > 0.0 ? (t_s - before->t_s) / gap_s : 0.0;
  const Rigid3 &a = before->world_from_cam, &b = after->world_from_cam;
  return Rigid3{a.rotation.slerp(share, b.rotation), (1.0 - share) * a.translation + share * b.translation};
}

Eigen::Matrix3d position_cov_at(std::span<const PathStep> path, double t_s) {
  const auto after = std::ranges::lower_bound(path, t_s, {}, &PathStep::t_s);
  if (after == path.end() || !after->has_pose()) return Eigen::Matrix3d::Zero();
  const Eigen::Matrix3d R = after->world_from_cam.rotation.toRotationMatrix();
  return R * after->cov.topLeftCorner<3, 3>() * R.transpose();
}

double persistent_square(std::span<const Eigen::Vector3d> left) {
  if (left.size() < 3) return 0.0;
  double squares = 0.0, steps = 0.0;
  for (std::size_t i = 0; i < left.size(); ++i) {
    squares += left[i].squaredNorm();
    if (i > 0) steps += 0.5 * (left[i] - left[i - 1]).squaredNorm();
  }
  const double num = static_cast<double>(left.size());
  return std::max(0.0, squares / num - steps / (num - 1.0));
}

std::vector<PathStep> filtered(std::span<const PathStep> path, double tau_s) {
  constexpr double forgotten = 3.0;  // time constants
  std::vector<PathStep> steps(path.begin(), path.end());
  const PathStep* last = nullptr;
  double since_s = 0.0;
  for (PathStep& step : steps) {
    if (!step.has_pose()) {
      last = nullptr;
      continue;
    }
    if (last == nullptr) {
      since_s = step.t_s;
    } else {
      // Between two frames the path is straight.
      const PathStep& now = path[static_cast<std::size_t>(&step - steps.data())];
      const PathStep& before = path[static_cast<std::size_t>(last - steps.data())];
      const double gap_s = step.t_s - last->t_s, kept = std::exp(-gap_s / tau_s);
      const Eigen::Vector3d speed = (now.world_from_cam.translation - before.world_from_cam.translation) / gap_s;
      const Eigen::Vector3d behind = last->world_from_cam.translation - before.world_from_cam.translation;
      step.world_from_cam.translation = now.world_from_cam.translation + kept * behind - (1.0 - kept) * tau_s * speed;
    }
    last = &step;
  }
  for (PathStep& step : steps)
    if (step.t_s < since_s + forgotten * tau_s) step.event = FrameEvent::waiting;
  return steps;
}

namespace {

constexpr double rejected_beyond = 4.0;  // of their robust σ

/// A reading's depth, and where the camera was.
struct DepthRow {
  double depth_m = 0.0, weight = 1.0;
  Eigen::Vector4d row = Eigen::Vector4d::Zero();  ///< Position, and one for the offset.
  double left = 0.0;                              ///< Of the depth, in σ.
};

/// How much less than their number they determine whose neighbours are alike: an autoregression of first order.
double inflation(std::span<const DepthRow> rows) {
  double products = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    squares += rows[i].left * rows[i].left;
    if (i > 0) products += rows[i].left * rows[i - 1].left;
  }
  const double correlation = squares > 0.0 ? std::clamp(products / squares, 0.0, 0.98) : 0.0;
  return (1.0 + correlation) / (1.0 - correlation);
}

struct DepthFit {
  Eigen::Vector4d values = Eigen::Vector4d::Zero();
  Eigen::Matrix4d cov = Eigen::Matrix4d::Zero();  ///< By the given σ.
};

std::optional<DepthFit> fitted(std::vector<DepthRow>& rows) {
  Eigen::Matrix4d H = Eigen::Matrix4d::Zero();
  Eigen::Vector4d g = Eigen::Vector4d::Zero();
  for (const DepthRow& row : rows) {
    H += row.weight * row.weight * row.row * row.row.transpose();
    g += row.weight * row.weight * row.depth_m * row.row;
  }
  // A path in a plane, or on a line, determines nothing of the direction across it: as good as none of it is downwards.
  constexpr double hardly = 1e-9;
  H.diagonal().head<3>().array() += hardly * H.diagonal().head<3>().sum();
  const Eigen::LDLT<Eigen::Matrix4d> ldlt(H);
  if (ldlt.info() != Eigen::Success) return std::nullopt;
  DepthFit fit{ldlt.solve(g), ldlt.solve(Eigen::Matrix4d::Identity())};
  if (!fit.values.allFinite() || !fit.cov.allFinite()) return std::nullopt;
  for (DepthRow& row : rows) row.left = row.weight * (row.depth_m - fit.values.dot(row.row));
  return fit;
}

std::vector<DepthRow> rows_at(std::span<const DepthReading> readings, double late_s, std::span<const PathStep> path) {
  std::vector<DepthRow> rows;
  for (const DepthReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s - late_s);
    if (!pose) continue;
    DepthRow row{reading.depth_m, 1.0 / reading.sigma_m, Eigen::Vector4d::Ones(), 0.0};
    row.row.head<3>() = pose->translation;
    rows.push_back(row);
  }
  return rows;
}

/// By the readings that are near the others; these are left in `rows`.
std::optional<DepthFit> fitted_without_far(std::vector<DepthRow>& rows) {
  constexpr std::size_t enough = 10;
  constexpr int rounds = 4;
  std::optional<DepthFit> fit;
  for (int round = 0; round < rounds; ++round) {
    if (rows.size() < enough) return std::nullopt;
    fit = fitted(rows);
    if (!fit) return std::nullopt;
    std::vector<double> sizes;
    for (const DepthRow& row : rows) sizes.push_back(std::abs(row.left));
    const double limit = rejected_beyond * std::max(1.0, normal_from_mad * median_of(std::move(sizes)));
    if (round + 1 < rounds) std::erase_if(rows, [&](const DepthRow& row) { return std::abs(row.left) > limit; });
  }
  return fit;
}

/// Mean square of what is left, in σ².
double misfit_of(std::vector<DepthRow> rows) {
  if (!fitted_without_far(rows)) return std::numeric_limits<double>::infinity();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  return squares / static_cast<double>(rows.size());
}

/// How late the readings' clock is, where that explains clearly more than no offset: the least of a parabola through
/// the best of a grid.
double clock_of(std::span<const DepthReading> readings, std::span<const PathStep> path) {
  constexpr double step_s = 0.05, clear = 12.0;  // of χ², 3.5σ
  constexpr int most = 20;
  std::array<double, 2 * most + 1> misfits{};
  for (int i = -most; i <= most; ++i)
    misfits[static_cast<std::size_t>(i + most)] = misfit_of(rows_at(readings, step_s * i, path));
  const auto best = static_cast<std::size_t>(std::ranges::min_element(misfits) - misfits.begin());
  std::vector<DepthRow> rows = rows_at(readings, step_s * (static_cast<double>(best) - most), path);
  if (best == 0 || best + 1 == misfits.size() || !std::isfinite(misfits[best - 1] + misfits[best + 1]) ||
      !fitted_without_far(rows))
    return 0.0;
  const double unit = std::max(1.0, misfits[best]) * inflation(rows) / static_cast<double>(rows.size());
  if (!(misfits[most] - misfits[best] > clear * unit)) return 0.0;
  const double curve = misfits[best - 1] - 2.0 * misfits[best] + misfits[best + 1];
  const double share = curve > 0.0 ? 0.5 * (misfits[best - 1] - misfits[best + 1]) / curve : 0.0;
  return step_s * (static_cast<double>(best) - most + std::clamp(share, -1.0, 1.0));
}

/// Time constant and clock of a sensor.
struct Follows {
  double tau_s = 0.0, late_s = 0.0, misfit = std::numeric_limits<double>::infinity();
  double rival_tau_s = 0.0, rival_late_s = 0.0;  ///< A filter that is half believed.
};

/// A filter delays what it is shown by its time constant, as a late clock does, and makes it smaller, as no clock does:
/// that with the least misfit, if it explains clearly more than the clock alone. Nothing is looked for where the clock
/// is right and neighbours err by themselves.
Follows follows(std::span<const DepthReading> readings, double late_s, std::span<const PathStep> path) {
  constexpr double first_s = 0.05, last_s = 2.0, ratio = 1.1, step_s = 0.05, clear = 12.0, half_clear = 4.0,
                   alike = 3.0;
  constexpr int most = 2;  // beside a filter, the clock is right
  std::vector<DepthRow> rows = rows_at(readings, late_s, path);
  Follows best{.late_s = late_s, .misfit = misfit_of(rows)};
  const Follows clock = best;
  if (!fitted_without_far(rows) || (late_s == 0.0 && inflation(rows) < alike)) return clock;
  for (double tau_s = first_s; tau_s < last_s; tau_s *= ratio) {
    const std::vector<PathStep> shown = filtered(path, tau_s);
    for (int k = -most; k <= most; ++k) {
      const double late = k * step_s;
      const double misfit = misfit_of(rows_at(readings, late, shown));
      if (misfit < best.misfit) best = {.tau_s = tau_s, .late_s = late, .misfit = misfit};
    }
  }
  if (best.tau_s == 0.0) return clock;
  std::vector<DepthRow> explained = rows_at(readings, best.late_s, filtered(path, best.tau_s));
  if (!fitted_without_far(explained)) return clock;
  const double unit = best.misfit * inflation(explained) / static_cast<double>(explained.size());
  const double gain = (clock.misfit - best.misfit) / unit;
  if (gain > clear) return best;
  Follows doubtful = clock;
  if (gain > half_clear) doubtful.rival_tau_s = best.tau_s, doubtful.rival_late_s = best.late_s;
  return doubtful;
}

}  // namespace

std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                        std::span<const PathStep> path) {
  const Follows found = follows(readings, clock_of(readings, path), path);
  std::vector<DepthRow> rows = rows_at(
      readings, found.late_s, found.tau_s > 0.0 ? filtered(path, found.tau_s) : std::vector(path.begin(), path.end()));
  const std::size_t num_given = rows.size();
  const auto fit = fitted_without_far(rows);
  if (!fit) return std::nullopt;
  const Eigen::Vector3d g = fit->values.head<3>();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  const double worse = std::max(1.0, squares / (static_cast<double>(rows.size()) - 4.0)) * inflation(rows);
  const Eigen::Matrix3d cov = worse * fit->cov.topLeftCorner<3, 3>();
  ReadScale read{g.norm(), 1.0, rows.size(), num_given - rows.size(), found.late_s, 0.0, 0.0, 0.0, found.tau_s};
  if (!(read.scale > 0.0)) return std::nullopt;
  const Eigen::Vector3d along = g / read.scale;
  const double variance = along.dot(cov * along), across = cov.trace() - variance;
  // |g| grows by what is not known across it.
  read.sigma_rel = std::hypot(std::sqrt(variance) / read.scale, 0.5 * across / (read.scale * read.scale), sigma_rel);
  if (found.rival_tau_s > 0.0) {
    std::vector<DepthRow> others = rows_at(readings, found.rival_late_s, filtered(path, found.rival_tau_s));
    const auto other = fitted_without_far(others);
    if (other) read.sigma_rel = std::hypot(read.sigma_rel, std::log(other->values.head<3>().norm() / read.scale));
  }
  constexpr double useless = 0.2, misfit = 0.5;
  if (!(read.sigma_rel < useless) || static_cast<double>(rows.size()) < misfit * static_cast<double>(num_given))
    return std::nullopt;
  return read;
}

}  // namespace alidade
