#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/checks/scale_readings.h"

// A rangefinder's scale: where its beam meets the surface that the map's points lie on.

namespace alidade {

namespace {

struct NearPoint {
  double off = 0.0;  ///< From the beam, over the depth.
  Eigen::Vector3d point_in_world;
};

struct BeamScale {
  double log_scale = 0.0, roughness = 0.0;  ///< The points off their plane, over the distance.
  double of_offset = 0.0;                   ///< ∂scale / ∂(length of all readings). [units/m]
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
  const double of_beam = normal.dot(beam.scale * beam.direction_in_cam);
  constexpr double grazing = 0.3;
  if (std::abs(of_hit) < grazing * hit_in_cam.norm() || roughness > max_roughness * middle.norm()) return std::nullopt;
  // n·X = c in units; where the beam hits it is s c in metres.
  const double scale = of_hit / to_plane;
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  return BeamScale{std::log(scale), roughness / middle.norm(), of_beam / to_plane};
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

/// Those near their median.
void reject_far(std::vector<BeamScale>& scales) {
  constexpr double far = 4.0;  // of their robust σ
  std::vector<double> logs, sizes;
  for (const BeamScale& each : scales) logs.push_back(each.log_scale);
  const double median = median_of(logs);
  for (const double log : logs) sizes.push_back(std::abs(log - median));
  const double limit = far * normal_from_mad * median_of(std::move(sizes));
  std::erase_if(scales, [&](const BeamScale& each) { return std::abs(each.log_scale - median) > limit; });
}

constexpr std::size_t num_blocks = 10;

/// ln of the scale, with the scatter of blocks of time as its σ.
struct MeanScale {
  double log_scale = 0.0, sigma = 0.0;
};

MeanScale mean_of_blocks(std::span<const BeamScale> scales) {
  double sum = 0.0, squares = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const std::size_t begin = i * scales.size() / num_blocks, end = (i + 1) * scales.size() / num_blocks;
    double of_block = 0.0;
    for (std::size_t k = begin; k < end; ++k) of_block += scales[k].log_scale / static_cast<double>(end - begin);
    sum += of_block;
    squares += of_block * of_block;
  }
  const double num = static_cast<double>(num_blocks), mean = sum / num;
  return {mean, std::sqrt(std::max(squares / num - mean * mean, 0.0) / (num - 1.0))};
}

/// All readings too long by one length: scale_i = S + x_i offset, with x_i the more the nearer the surface is.
struct OffsetFit {
  double scale = 1.0, offset_m = 0.0;
  double spread = 0.0;  ///< Standard deviation of x.
};

std::optional<OffsetFit> offset_fit(std::span<const BeamScale> scales, std::size_t but_begin, std::size_t but_end) {
  double num = 0.0, sum_x = 0.0, sum_y = 0.0, sum_xx = 0.0, sum_xy = 0.0;
  for (std::size_t i = 0; i < scales.size(); ++i) {
    if (i >= but_begin && i < but_end) continue;
    const double x = scales[i].of_offset, y = std::exp(scales[i].log_scale);
    num += 1.0;
    sum_x += x;
    sum_y += y;
    sum_xx += x * x;
    sum_xy += x * y;
  }
  const double variance = sum_xx / num - sum_x * sum_x / (num * num);
  if (!(variance > 1e-12 * sum_xx / num)) return std::nullopt;
  const double slope = (sum_xy / num - sum_x * sum_y / (num * num)) / variance;
  return OffsetFit{(sum_y - slope * sum_x) / num, slope, std::sqrt(variance)};
}

/// σ by the jackknife over blocks of time.
struct OffsetSigma {
  double of_log_scale = 0.0, of_offset_m = 0.0;
};

std::optional<OffsetSigma> sigma_of(const OffsetFit& fit, std::span<const BeamScale> scales) {
  double of_scale = 0.0, of_offset = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const auto without = offset_fit(scales, i * scales.size() / num_blocks, (i + 1) * scales.size() / num_blocks);
    if (!without || !(without->scale > 0.0)) return std::nullopt;
    of_scale += std::pow(std::log(without->scale / fit.scale), 2);
    of_offset += std::pow(without->offset_m - fit.offset_m, 2);
  }
  const double share = (static_cast<double>(num_blocks) - 1.0) / static_cast<double>(num_blocks);
  return OffsetSigma{std::sqrt(share * of_scale), std::sqrt(share * of_offset)};
}

/// Where the distances say that the readings are all too long, that is estimated; where they half say so, its effect is
/// in σ. `of_surface`: relative error of each scale by the surface's shape, which may follow the distance.
void add_offset(std::span<const BeamScale> scales, const Beam& beam, double of_surface, ReadScale& read) {
  const auto fit = offset_fit(scales, 0, 0);
  if (!fit || !(fit->scale > 0.0)) return;
  const auto sigma = sigma_of(*fit, scales);
  if (!sigma) return;
  const double of_curvature = of_surface * fit->scale / fit->spread;
  const double of_beam =
      std::sqrt(std::max(beam.direction_in_cam.dot(beam.cov.topLeftCorner<3, 3>() * beam.direction_in_cam), 0.0));
  const double z = std::abs(fit->offset_m) / std::hypot(sigma->of_offset_m, of_curvature, of_beam);
  // t of nine degrees of freedom: as seldom as 3.5σ and 2σ of a normal distribution
  constexpr double clear = 5.3, half_clear = 2.3;
  const double change = std::log(fit->scale / read.scale);
  if (z > clear) {
    read.scale = fit->scale;
    read.offset_m = fit->offset_m;
    read.sigma_rel = std::hypot(read.sigma_rel, sigma->of_log_scale);
  } else if (z > half_clear) {
    read.sigma_rel = std::hypot(read.sigma_rel, change);
  }
}

}  // namespace

std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                        std::span<const PathStep> path, std::span<const MapPoint> map) {
  std::vector<BeamScale> scales;  // in order of time
  double roughness = 0.0;
  for (const RangeReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s);
    const auto scale = pose ? scale_at(*pose, beam, reading.range_m, map) : std::nullopt;
    if (!scale) continue;
    scales.push_back(*scale);
    roughness += scale->roughness;
  }
  if (scales.size() < 3 * num_blocks) return std::nullopt;
  const std::size_t num_given = scales.size();
  reject_far(scales);
  if (scales.size() < num_blocks) return std::nullopt;
  const MeanScale mean = mean_of_blocks(scales);
  ReadScale read{std::exp(mean.log_scale), 0.0, scales.size(), num_given - scales.size()};
  // A curved surface is on one side of every plane through its points, by about as much as they are off it.
  const double of_surface = roughness / static_cast<double>(num_given);
  read.sigma_rel = std::hypot(mean.sigma, sigma_by_beam(readings, beam, path, map), of_surface);
  add_offset(scales, beam, of_surface, read);
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

}  // namespace alidade
