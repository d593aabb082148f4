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

std::vector<PathStep> without_jitter(std::span<const PathStep> path, double half_s) {
  constexpr std::size_t enough = 5;
  std::vector<PathStep> steps(path.begin(), path.end());
  std::size_t first = 0, last = 0;
  for (std::size_t i = 0; i < path.size(); ++i) {
    while (path[i].t_s - path[first].t_s > half_s) ++first;
    while (last < path.size() && path[last].t_s - path[i].t_s <= half_s) ++last;
    if (!path[i].has_pose() || last - first < enough) continue;
    Eigen::Matrix3d H = Eigen::Matrix3d::Zero(), g = Eigen::Matrix3d::Zero();
    std::size_t num = 0;
    for (std::size_t k = first; k < last; ++k) {
      if (!path[k].has_pose()) continue;
      const double t = (path[k].t_s - path[i].t_s) / half_s;
      const Eigen::Vector3d powers(1.0, t, t * t);
      H += powers * powers.transpose();
      g += powers * path[k].world_from_cam.translation.transpose();
      ++num;
    }
    if (num >= enough) steps[i].world_from_cam.translation = (H.inverse() * g).row(0).transpose();
  }
  return steps;
}

namespace {

constexpr double rejected_beyond = 4.0;  // of their robust σ

/// Readings of a depth sensor, and from when on they have another offset.
struct Depths {
  std::span<const DepthReading> readings;
  double jump_s = std::numeric_limits<double>::infinity();
};

using DepthVector = Eigen::Vector<double, 5>;
using DepthMatrix = Eigen::Matrix<double, 5, 5>;

/// A reading's depth, and where the camera was.
struct DepthRow {
  double depth_m = 0.0, weight = 1.0;
  DepthVector row = DepthVector::Zero();  ///< Position, one for the offset, and one after a jump.
  double left = 0.0;                      ///< Of the depth, in σ.
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
  DepthVector values = DepthVector::Zero();
  DepthMatrix cov = DepthMatrix::Zero();  ///< By the given σ.
  double limit = 0.0;                     ///< Beyond which a reading is rejected, in σ.
};

std::optional<DepthFit> fitted(std::vector<DepthRow>& rows) {
  DepthMatrix H = DepthMatrix::Zero();
  DepthVector g = DepthVector::Zero();
  for (const DepthRow& row : rows) {
    H += row.weight * row.weight * row.row * row.row.transpose();
    g += row.weight * row.weight * row.depth_m * row.row;
  }
  // A path in a plane, or on a line, determines nothing of the direction across it: as good as none of it is downwards.
  constexpr double hardly = 1e-9;
  H.diagonal().head<3>().array() += hardly * H.diagonal().head<3>().sum();
  if (H(4, 4) == 0.0) H(4, 4) = 1.0;  // no jump
  const Eigen::LDLT<DepthMatrix> ldlt(H);
  if (ldlt.info() != Eigen::Success) return std::nullopt;
  DepthFit fit{ldlt.solve(g), ldlt.solve(DepthMatrix::Identity())};
  if (!fit.values.allFinite() || !fit.cov.allFinite()) return std::nullopt;
  for (DepthRow& row : rows) row.left = row.weight * (row.depth_m - fit.values.dot(row.row));
  return fit;
}

std::vector<DepthRow> rows_at(const Depths& depths, double late_s, std::span<const PathStep> path) {
  std::vector<DepthRow> rows;
  for (const DepthReading& reading : depths.readings) {
    const auto pose = pose_at(path, reading.t_s - late_s);
    if (!pose) continue;
    DepthRow row{reading.depth_m, 1.0 / reading.sigma_m, DepthVector::Ones(), 0.0};
    row.row.head<3>() = pose->translation;
    row.row[4] = reading.t_s > depths.jump_s ? 1.0 : 0.0;
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
    fit->limit = limit;
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
double clock_of(const Depths& depths, std::span<const PathStep> path) {
  constexpr double step_s = 0.05, clear = 12.0;  // of χ², 3.5σ
  constexpr int most = 20;
  std::array<double, 2 * most + 1> misfits{};
  for (int i = -most; i <= most; ++i)
    misfits[static_cast<std::size_t>(i + most)] = misfit_of(rows_at(depths, step_s * i, path));
  const auto best = static_cast<std::size_t>(std::ranges::min_element(misfits) - misfits.begin());
  std::vector<DepthRow> rows = rows_at(depths, step_s * (static_cast<double>(best) - most), path);
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
Follows follows(const Depths& depths, double late_s, std::span<const PathStep> path) {
  constexpr double first_s = 0.05, last_s = 2.0, ratio = 1.1, step_s = 0.05, clear = 12.0, half_clear = 4.0,
                   alike = 3.0;
  constexpr int most = 2;  // beside a filter, the clock is right
  std::vector<DepthRow> rows = rows_at(depths, late_s, path);
  const std::size_t num_given = rows.size();
  Follows best{.late_s = late_s, .misfit = misfit_of(rows)};
  const Follows clock = best;
  if (!fitted_without_far(rows) || (late_s == 0.0 && inflation(rows) < alike)) return clock;
  for (double tau_s = first_s; tau_s < last_s; tau_s *= ratio) {
    const std::vector<PathStep> shown = filtered(path, tau_s);
    if (2 * rows_at(depths, 0.0, shown).size() < num_given) break;  // what is left of the readings fits anything
    for (int k = -most; k <= most; ++k) {
      const double late = k * step_s;
      const double misfit = misfit_of(rows_at(depths, late, shown));
      if (misfit < best.misfit) best = {.tau_s = tau_s, .late_s = late, .misfit = misfit};
    }
  }
  if (best.tau_s == 0.0) return clock;
  std::vector<DepthRow> explained = rows_at(depths, best.late_s, filtered(path, best.tau_s));
  if (!fitted_without_far(explained)) return clock;
  const double unit = best.misfit * inflation(explained) / static_cast<double>(explained.size());
  const double gain = (clock.misfit - best.misfit) / unit;
  if (gain > clear) return best;
  Follows doubtful = clock;
  if (gain > half_clear) doubtful.rival_tau_s = best.tau_s, doubtful.rival_late_s = best.late_s;
  return doubtful;
}

/// How all readings fit: where one is far off, as far as it would just not be rejected.
struct DepthCost {
  double cost = std::numeric_limits<double>::infinity();  ///< Mean, in σ².
  double unit = 1.0;                                      ///< Of it, what one of them all is by chance.
  double alike = 1.0, rejected = 0.0;                     ///< Inflation, and share.
  double limit = 0.0;                                     ///< Beyond which they are, in σ.
};

DepthCost cost_of(const std::vector<DepthRow>& rows, std::optional<double> limit = {}) {
  std::vector<DepthRow> near = rows;
  const auto fit = fitted_without_far(near);
  if (!fit) return {};
  DepthCost cost{0.0, 1.0, inflation(near), 0.0, limit.value_or(fit->limit)};
  const auto num = static_cast<double>(rows.size());
  for (const DepthRow& row : rows) {
    const double left = row.weight * (row.depth_m - fit->values.dot(row.row));
    cost.cost += std::min(left * left, cost.limit * cost.limit) / num;
    cost.rejected += std::abs(left) > cost.limit ? 1.0 / num : 0.0;
  }
  cost.unit = std::max(1.0, cost.cost) * cost.alike / num;
  return cost;
}

/// When the readings begin to have another offset, as where a sensor is set to zero or moved on its vehicle: where that
/// explains clearly more than nothing, a clock or a filter (5.5σ at one of a hundred times), and leaves nothing that
/// neighbours share, as a tide would. Without it the rest of the path goes up or down by the jump, and what is left
/// looks like a filter. Nothing is looked for where neighbours err by themselves.
double jump_of(const Depths& depths, std::span<const PathStep> path) {
  constexpr double clear = 30.0, alike = 3.0, few = 0.05;
  constexpr std::size_t ends = 5, most = 100;
  const std::vector<DepthRow> rows = rows_at(depths, 0.0, path);
  const DepthCost without = cost_of(rows);
  std::vector<double> t_s;
  for (const DepthReading& reading : depths.readings)
    if (pose_at(path, reading.t_s)) t_s.push_back(reading.t_s);
  if (t_s.size() < 4 * ends || (without.alike < alike && without.rejected < few)) return Depths{}.jump_s;
  std::size_t best = 0;
  DepthCost least;
  const auto look = [&](std::size_t from, std::size_t to, std::size_t stride) {
    for (std::size_t k = std::max(from, ends); k <= std::min(to, t_s.size() - ends); k += stride) {
      const DepthCost at = cost_of(rows_at({depths.readings, 0.5 * (t_s[k - 1] + t_s[k])}, 0.0, path));
      if (at.cost < least.cost) least = at, best = k;
    }
  };
  const std::size_t stride = std::max(t_s.size() / most, std::size_t{1});
  look(ends, t_s.size() - ends, stride);
  if (stride > 1 && best > 0) look(best - stride + 1, best + stride - 1, std::max(stride / 10, std::size_t{1}));
  const auto is_worse = [&](const std::vector<DepthRow>& other) {
    return cost_of(other, least.limit).cost - least.cost > clear * least.unit;
  };
  if (best == 0 || !(least.alike < alike) || !is_worse(rows)) return Depths{}.jump_s;
  const Follows other = follows(depths, clock_of(depths, path), path);
  const auto shown = other.tau_s > 0.0 ? filtered(path, other.tau_s) : std::vector(path.begin(), path.end());
  return is_worse(rows_at(depths, other.late_s, shown)) ? 0.5 * (t_s[best - 1] + t_s[best]) : Depths{}.jump_s;
}

}  // namespace

std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                        std::span<const PathStep> path) {
  Depths depths{readings};
  depths.jump_s = jump_of(depths, path);
  const Follows found = follows(depths, clock_of(depths, path), path);
  std::vector<DepthRow> rows = rows_at(
      depths, found.late_s, found.tau_s > 0.0 ? filtered(path, found.tau_s) : std::vector(path.begin(), path.end()));
  const std::size_t num_given = rows.size();
  const auto fit = fitted_without_far(rows);
  if (!fit) return std::nullopt;
  const Eigen::Vector3d g = fit->values.head<3>();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  const double worse = std::max(1.0, squares / (static_cast<double>(rows.size()) - 5.0)) * inflation(rows);
  const Eigen::Matrix3d cov = worse * fit->cov.topLeftCorner<3, 3>();
  ReadScale read{g.norm(), 1.0, rows.size(), num_given - rows.size(), found.late_s, 0.0, 0.0, 0.0, found.tau_s};
  if (std::isfinite(depths.jump_s)) read.jump_m = fit->values[4], read.jump_s = depths.jump_s;
  if (!(read.scale > 0.0)) return std::nullopt;
  const Eigen::Vector3d along = g / read.scale;
  const double variance = along.dot(cov * along), across = cov.trace() - variance;
  // |g| grows by what is not known across it.
  read.sigma_rel = std::hypot(std::sqrt(variance) / read.scale, 0.5 * across / (read.scale * read.scale), sigma_rel);
  if (found.rival_tau_s > 0.0) {
    std::vector<DepthRow> others = rows_at(depths, found.rival_late_s, filtered(path, found.rival_tau_s));
    const auto other = fitted_without_far(others);
    if (other) read.sigma_rel = std::hypot(read.sigma_rel, std::log(other->values.head<3>().norm() / read.scale));
  }
  constexpr double useless = 0.2, misfit = 0.5;
  if (!(read.sigma_rel < useless) || static_cast<double>(rows.size()) < misfit * static_cast<double>(num_given))
    return std::nullopt;
  return read;
}

}  // namespace alidade
