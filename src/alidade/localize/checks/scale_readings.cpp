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

}  // namespace

std::optional<ReadScale> scale_by_depth(std::span<const DepthReading> readings, double sigma_rel,
                                        std::span<const PathStep> path) {
  const double late_s = clock_of(readings, path);
  std::vector<DepthRow> rows = rows_at(readings, late_s, path);
  const std::size_t num_given = rows.size();
  const auto fit = fitted_without_far(rows);
  if (!fit) return std::nullopt;
  const Eigen::Vector3d g = fit->values.head<3>();
  double squares = 0.0;
  for (const DepthRow& row : rows) squares += row.left * row.left;
  const double worse = std::max(1.0, squares / (static_cast<double>(rows.size()) - 4.0)) * inflation(rows);
  const Eigen::Matrix3d cov = worse * fit->cov.topLeftCorner<3, 3>();
  ReadScale read{g.norm(), 1.0, rows.size(), num_given - rows.size(), late_s};
  if (!(read.scale > 0.0)) return std::nullopt;
  const Eigen::Vector3d along = g / read.scale;
  const double variance = along.dot(cov * along), across = cov.trace() - variance;
  // |g| grows by what is not known across it.
  read.sigma_rel = std::hypot(std::sqrt(variance) / read.scale, 0.5 * across / (read.scale * read.scale), sigma_rel);
  constexpr double useless = 0.2, misfit = 0.5;
  if (!(read.sigma_rel < useless) || static_cast<double>(rows.size()) < misfit * static_cast<double>(num_given))
    return std::nullopt;
  return read;
}

namespace {

struct NearPoint {
  double off = 0.0;  ///< From the beam, over the depth.
  Eigen::Vector3d point_in_world;
};

struct BeamScale {
  double log_scale = 0.0, roughness = 0.0;  ///< The points off their plane, over the distance.
};

/// Metres a unit where the beam hits the plane through the points that are nearest to it. None: too few around it.
std::optional<BeamScale> scale_at(const Rigid3& world_from_cam, const Beam& beam, double range_m,
                                  std::span<const MapPoint> map) {
  constexpr std::size_t num_near = 6;
  constexpr double far_off = 0.25, max_roughness = 0.1;
  const Eigen::Vector3d hit_in_cam = point_at(beam, range_m);
  const Eigen::Vector3d direction = hit_in_cam.normalized();  // the camera's centre alone has no scale
  const Rigid3 cam_from_world = world_from_cam.inverse();
  std::vector<NearPoint> near;
  for (const MapPoint& point : map) {
    const Eigen::Vector3d point_in_cam = cam_from_world * point.point_in_world;
    const double along = direction.dot(point_in_cam);
    if (!(along > 0.0)) continue;
    const double off = (point_in_cam - along * direction).norm() / along;
    if (off < far_off) near.push_back({off, point_in_cam});
  }
  if (near.size() < num_near) return std::nullopt;
  std::ranges::nth_element(near, near.begin() + num_near - 1, {}, &NearPoint::off);
  near.resize(num_near);
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const NearPoint& point : near) middle += point.point_in_world / static_cast<double>(num_near);
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const NearPoint& point : near)
    scatter += (point.point_in_world - middle) * (point.point_in_world - middle).transpose();
  const SymmetricEigen3 eigen = symmetric_eigen3(scatter);
  const Eigen::Vector3d normal = eigen.vectors.col(0);
  const double roughness = std::sqrt(std::max(eigen.values[0], 0.0) / static_cast<double>(num_near));
  const double to_plane = normal.dot(middle), of_hit = normal.dot(hit_in_cam);
  constexpr double grazing = 0.3;
  if (std::abs(of_hit) < grazing * hit_in_cam.norm() || roughness > max_roughness * middle.norm()) return std::nullopt;
  // n·X = c in units; where the beam hits it is s c in metres.
  const double scale = of_hit / to_plane;
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  return BeamScale{std::log(scale), roughness / middle.norm()};
}

/// Of the log of the scale by the beam's parameters: the median over the readings, since a moved beam may hit between
/// other points.
BeamVector of_beam_params(std::span<const RangeReading> readings, const Beam& beam, std::span<const PathStep> path,
                          std::span<const MapPoint> map) {
  constexpr double step = 1e-5;  // m, rad and shares alike
  std::array<std::vector<double>, num_beam_params> slopes;
  for (const RangeReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s);
    const auto scale = pose ? scale_at(*pose, beam, reading.range_m, map) : std::nullopt;
    if (!scale) continue;
    for (int k = 0; k < num_beam_params; ++k) {
      const auto moved = scale_at(*pose, beam.retract(step * BeamVector::Unit(k)), reading.range_m, map);
      if (moved) slopes[static_cast<std::size_t>(k)].push_back((moved->log_scale - scale->log_scale) / step);
    }
  }
  BeamVector along = BeamVector::Zero();
  for (int k = 0; k < num_beam_params; ++k) {
    std::vector<double>& each = slopes[static_cast<std::size_t>(k)];
    if (!each.empty()) along[k] = median_of(std::move(each));
  }
  return along;
}

/// σ of the scale by what is not known of the beam: an ordinary 0.5 % of its scale where the file says nothing.
double sigma_by_beam(std::span<const RangeReading> readings, const Beam& beam, std::span<const PathStep> path,
                     std::span<const MapPoint> map) {
  constexpr double ordinary_scale = 0.005;
  if (!(beam.cov.diagonal().maxCoeff() > 0.0)) return ordinary_scale;
  const BeamVector along = of_beam_params(readings, beam, path, map);
  return std::sqrt(std::max(along.dot(beam.cov * along), 0.0));
}

}  // namespace

std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                        std::span<const PathStep> path, std::span<const MapPoint> map) {
  std::vector<double> logs;  // in order of time
  double roughness = 0.0;
  for (const RangeReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s);
    const auto scale = pose ? scale_at(*pose, beam, reading.range_m, map) : std::nullopt;
    if (!scale) continue;
    logs.push_back(scale->log_scale);
    roughness += scale->roughness;
  }
  constexpr std::size_t num_blocks = 10;
  if (logs.size() < 3 * num_blocks) return std::nullopt;
  const std::size_t num_given = logs.size();
  const double median = median_of(logs);
  std::vector<double> sizes;
  for (const double log : logs) sizes.push_back(std::abs(log - median));
  const double limit = rejected_beyond * normal_from_mad * median_of(std::move(sizes));
  std::erase_if(logs, [&](double log) { return std::abs(log - median) > limit; });
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const std::size_t begin = i * logs.size() / num_blocks, end = (i + 1) * logs.size() / num_blocks;
    double of_block = 0.0;
    for (std::size_t k = begin; k < end; ++k) of_block += logs[k] / static_cast<double>(end - begin);
    sum += of_block;
    squares += of_block * of_block;
  }
  const double num = static_cast<double>(num_blocks), mean = sum / num;
  ReadScale read{std::exp(mean), 0.0, logs.size(), num_given - logs.size()};
  const double of_beam = sigma_by_beam(readings, beam, path, map);
  // A curved surface is on one side of every plane through its points, by about as much as they are off it.
  const double of_surface = roughness / static_cast<double>(num_given);
  const double of_blocks = std::sqrt(std::max(squares / num - mean * mean, 0.0) / (num - 1.0));
  read.sigma_rel = std::hypot(of_blocks, of_beam, of_surface);
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

}  // namespace alidade
