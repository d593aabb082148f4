#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/checks/beam_surfaces.h"
#include "alidade/localize/checks/scale_readings.h"

// A rangefinder's scale: where its beam meets the surface that the map's points lie on.

namespace alidade {

namespace {

struct BeamScale {
  double log_scale = 0.0, roughness = 0.0;                 ///< The points off their plane, over the distance.
  double of_offset = 0.0;                                  ///< ∂scale / ∂(length of all readings). [units/m]
  Eigen::Vector2d of_direction = Eigen::Vector2d::Zero();  ///< ∂scale / ∂(direction of the beam). [units/rad]
};

/// Which surface a beam meets.
enum class SurfaceBy {
  nearest,  ///< Through the nearest points.
  around,   ///< Any through points in one plane all around the beam: where one stands before another, which one do the
            ///< readings say together.
};

std::vector<BeamSurface> surfaces_of(const Eigen::Vector3d& hit_in_cam, std::span<const Eigen::Vector3d> points_in_cam,
                                     SurfaceBy by) {
  const Eigen::Vector3d direction = hit_in_cam.normalized();  // the camera's centre alone has no scale
  if (by == SurfaceBy::around) return surfaces_around(direction, points_in_cam);
  const auto surface = nearest_surface(direction, points_in_cam);
  return surface ? std::vector{*surface} : std::vector<BeamSurface>();
}

std::optional<BeamScale> scale_on(const BeamSurface& surface, const Beam& beam, double range_m) {
  constexpr double max_roughness = 0.1, grazing = 0.3;
  const Eigen::Vector3d hit_in_cam = point_at(beam, range_m);
  const double to_plane = surface.normal.dot(surface.middle), of_hit = surface.normal.dot(hit_in_cam);
  const double of_beam = surface.normal.dot(beam.scale * beam.direction_in_cam);
  const double distance = surface.middle.norm();
  if (std::abs(of_hit) < grazing * hit_in_cam.norm() || surface.roughness > max_roughness * distance)
    return std::nullopt;
  // n·X = c in units; where the beam hits it is s c in metres.
  const double scale = of_hit / to_plane;
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  const Eigen::RowVectorXd of_params = surface.normal.transpose() * J_point_beam(beam, range_m) / to_plane;
  return BeamScale{std::log(scale), surface.roughness / distance, of_beam / to_plane,
                   of_params.segment<2>(beam_direction_param).transpose()};
}

/// Metres a unit where the beam hits a plane through points near it, for each such plane.
std::vector<BeamScale> scales_at(const Rigid3& world_from_cam, const Beam& beam, double range_m,
                                 std::span<const MapPoint> map, SurfaceBy by) {
  const Rigid3 cam_from_world = world_from_cam.inverse();
  std::vector<Eigen::Vector3d> points_in_cam;
  points_in_cam.reserve(map.size());
  for (const MapPoint& point : map) points_in_cam.push_back(cam_from_world * point.point_in_world);
  std::vector<BeamScale> scales;
  for (const BeamSurface& surface : surfaces_of(point_at(beam, range_m), points_in_cam, by))
    if (auto scale = scale_on(surface, beam, range_m)) scales.push_back(*scale);
  return scales;
}

std::optional<BeamScale> scale_at(const Rigid3& world_from_cam, const Beam& beam, double range_m,
                                  std::span<const MapPoint> map) {
  const std::vector<BeamScale> scales = scales_at(world_from_cam, beam, range_m, map, SurfaceBy::nearest);
  return scales.empty() ? std::nullopt : std::optional(scales.front());
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

/// One scale of each reading, and ln of another over it that at least half as many of them have.
struct AgreeingScales {
  std::vector<BeamScale> scales;
  double other_log_scale = 0.0;
};

/// Of each reading the scale that most of the others have, too: a kernel's mode. None where too few agree: the beam may
/// have met none of these surfaces, as within a frame of points.
std::optional<AgreeingScales> agreeing(std::span<const std::vector<BeamScale>> of_readings) {
  constexpr double width = 0.01, apart = 3.0, half = 0.5, enough = 0.6;
  const auto nearest = [](const std::vector<BeamScale>& scales, double log_scale) {
    return *std::ranges::min_element(scales, {},
                                     [&](const BeamScale& each) { return std::abs(each.log_scale - log_scale); });
  };
  std::vector<std::pair<double, double>> supports;  // and scales
  for (const std::vector<BeamScale>& at : of_readings)
    for (const BeamScale& one : at) {
      double sum = 0.0;
      for (const std::vector<BeamScale>& scales : of_readings)
        sum += std::exp(-0.5 * std::pow((nearest(scales, one.log_scale).log_scale - one.log_scale) / width, 2));
      supports.emplace_back(sum, one.log_scale);
    }
  std::ranges::sort(supports, std::greater());
  const auto [most, mode] = supports.front();
  if (most < enough * static_cast<double>(of_readings.size())) return std::nullopt;
  AgreeingScales agreeing;
  for (const std::vector<BeamScale>& scales : of_readings) agreeing.scales.push_back(nearest(scales, mode));
  for (const auto& [sum, log_scale] : supports)
    if (agreeing.other_log_scale == 0.0 && sum > half * most && std::abs(log_scale - mode) > apart * width)
      agreeing.other_log_scale = log_scale - mode;
  return agreeing;
}

constexpr std::size_t num_blocks = 10;

/// Of each reading that has a surface its scales, in order of time.
std::vector<std::vector<BeamScale>> scales_by(SurfaceBy by, std::span<const RangeReading> readings, const Beam& beam,
                                              std::span<const PathStep> path, std::span<const MapPoint> map) {
  std::vector<std::vector<BeamScale>> of_readings;
  for (const RangeReading& reading : readings) {
    const auto pose = pose_at(path, reading.t_s);
    if (!pose) continue;
    auto scales = scales_at(*pose, beam, reading.range_m, map, by);
    if (!scales.empty()) of_readings.push_back(std::move(scales));
  }
  return of_readings;
}

/// One scale of each reading: by planes all around the beam, where enough have them and agree.
AgreeingScales scales_of(std::span<const RangeReading> readings, const Beam& beam, std::span<const PathStep> path,
                         std::span<const MapPoint> map) {
  constexpr std::size_t enough = 3 * num_blocks;
  const auto around = scales_by(SurfaceBy::around, readings, beam, path, map);
  if (around.size() >= enough)
    if (auto agree = agreeing(around)) return *std::move(agree);
  AgreeingScales nearest;
  for (const std::vector<BeamScale>& each : scales_by(SurfaceBy::nearest, readings, beam, path, map))
    nearest.scales.push_back(each.front());
  if (nearest.scales.size() < enough) nearest.scales.clear();
  return nearest;
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

/// Something of the beam that is not as given: scale_i = S + x_i · by, with x of a reading the more, the more that
/// changes its scale.
struct BeamFault {
  Eigen::Index num = 1;  ///< Of its numbers.
  Eigen::VectorXd (*x_of)(const BeamScale&);
  double clear, half_clear;  ///< Of T² with nine degrees of freedom: as seldom as 3.5σ and 2σ of a normal distribution.
};
/// All readings are too long by one length.
const BeamFault offset_fault{
    1, [](const BeamScale& each) { return Eigen::VectorXd::Constant(1, each.of_offset).eval(); }, 28.6, 5.4};
/// The beam points elsewhere.
const BeamFault direction_fault{2, [](const BeamScale& each) -> Eigen::VectorXd { return each.of_direction; }, 52.3,
                                10.5};

struct FaultFit {
  double scale = 1.0, left2 = 0.0;  ///< What is left over, squared.
  Eigen::VectorXd by, spread;       ///< Standard deviations of x.
};

std::optional<FaultFit> fault_fit(const BeamFault& fault, std::span<const BeamScale> scales, std::size_t but_begin,
                                  std::size_t but_end) {
  const Eigen::Index size = fault.num + 1;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(size, size);
  Eigen::VectorXd g = Eigen::VectorXd::Zero(size), row = Eigen::VectorXd::Ones(size);
  double squares = 0.0;
  for (std::size_t i = 0; i < scales.size(); ++i) {
    if (i >= but_begin && i < but_end) continue;
    const double y = std::exp(scales[i].log_scale);
    row.tail(fault.num) = fault.x_of(scales[i]);
    H += row * row.transpose();
    g += y * row;
    squares += y * y;
  }
  FaultFit fit;
  const Eigen::VectorXd mean = H.col(0).tail(fault.num) / H(0, 0);
  const Eigen::VectorXd square = H.diagonal().tail(fault.num) / H(0, 0);
  fit.spread = (square - mean.cwiseAbs2()).cwiseMax(0.0).cwiseSqrt();
  const Ldlt ldlt(H);
  constexpr double hardly = 1e-10;
  if (!(ldlt.min_pivot() > hardly * H(0, 0)) || !(fit.spread.minCoeff() > 0.0)) return std::nullopt;
  const Eigen::VectorXd solution = ldlt.inverse() * g;
  fit.scale = solution[0];
  fit.by = solution.tail(fault.num);
  fit.left2 = std::max(squares - solution.dot(g), 0.0);
  return fit;
}

/// A fault as estimated: by the jackknife over blocks of time, the surface's shape and what is known of the beam.
struct FoundFault {
  FaultFit fit;
  double sigma_log_scale = 0.0, T2 = 0.0;
  Eigen::VectorXd sigma_by;
};

/// `of_surface`: relative error of each scale by the surface's shape, which may follow x.
std::optional<FoundFault> found_fault(const BeamFault& fault, std::span<const BeamScale> scales,
                                      const Eigen::MatrixXd& of_beam, double of_surface) {
  const auto fit = fault_fit(fault, scales, 0, 0);
  if (!fit || !(fit->scale > 0.0)) return std::nullopt;
  FoundFault found;
  found.fit = *fit;
  Eigen::MatrixXd cov = Eigen::MatrixXd::Zero(fault.num, fault.num);
  double of_scale = 0.0;
  for (std::size_t i = 0; i < num_blocks; ++i) {
    const auto without = fault_fit(fault, scales, i * scales.size() / num_blocks, (i + 1) * scales.size() / num_blocks);
    if (!without || !(without->scale > 0.0)) return std::nullopt;
    of_scale += std::pow(std::log(without->scale / fit->scale), 2);
    cov += (without->by - fit->by) * (without->by - fit->by).transpose();
  }
  const double share = (static_cast<double>(num_blocks) - 1.0) / static_cast<double>(num_blocks);
  cov = share * cov + of_beam;
  cov.diagonal() += (of_surface * fit->scale * fit->spread.cwiseInverse()).cwiseAbs2();
  found.sigma_log_scale = std::sqrt(share * of_scale);
  found.sigma_by = cov.diagonal().cwiseSqrt();
  found.T2 = fit->by.dot(Ldlt(cov).inverse() * fit->by);
  return found;
}

constexpr double instrument_m = 0.1;  ///< An offset of the readings is about as long as that, from its other end.

/// How much of the scale an offset of the readings would be that is as long as an instrument, measured from its other
/// end, where no covariance of the beam and not the readings themselves exclude it: a surface's shape, or a distance
/// that hardly changes, hides it. 0: it would show.
double hidden_offset(std::span<const BeamScale> scales, const Beam& beam, const std::optional<FoundFault>& offset,
                     double scale) {
  constexpr double sigmas = 3.3;  // an offset so large is beyond 2σ, that is in doubt, in five of six cases
  if (beam.cov.diagonal().maxCoeff() > 0.0) return 0.0;
  if (offset && sigmas * offset->sigma_by[0] < instrument_m) return 0.0;
  double of_offset = 0.0;
  for (const BeamScale& each : scales) of_offset += std::abs(each.of_offset) / static_cast<double>(scales.size());
  return instrument_m * of_offset / scale;
}

/// Where the readings say that they are all too long, or that the beam points elsewhere, that which explains more is
/// estimated; where they half say so, its effect is in σ.
void add_faults(std::span<const BeamScale> scales, const Beam& beam, double of_surface, ReadScale& read) {
  const Eigen::Vector3d along = beam.direction_in_cam;
  const Eigen::MatrixXd along_beam = Eigen::MatrixXd::Constant(1, 1, along.dot(beam.cov.topLeftCorner<3, 3>() * along)),
                        of_direction = beam.cov.block<2, 2>(beam_direction_param, beam_direction_param);
  const auto offset = found_fault(offset_fault, scales, along_beam, of_surface),
             direction = found_fault(direction_fault, scales, of_direction, of_surface);
  const bool is_offset = offset && offset->T2 > offset_fault.clear,
             is_direction = direction && direction->T2 > direction_fault.clear;
  const bool is_more_direction = is_direction && (!is_offset || direction->fit.left2 < offset->fit.left2);
  const auto put = [&](const FoundFault& found) {
    read.scale = found.fit.scale;
    read.sigma_rel = std::hypot(read.sigma_rel, found.sigma_log_scale);
  };
  const double before = read.scale;
  const auto doubt = [&](const std::optional<FoundFault>& found, const BeamFault& fault, double believed) {
    if (found && found->T2 > fault.half_clear)
      read.sigma_rel = std::hypot(read.sigma_rel, believed * std::log(found->fit.scale / before));
  };
  if (is_more_direction) {
    put(*direction);
    read.aside_rad = direction->fit.by.norm();
  } else if (is_offset) {
    put(*offset);
    read.offset_m = offset->fit.by[0];
  } else {
    // Where hardly anything determines an offset, what an instrument has is surer.
    const double known = offset ? std::pow(offset->sigma_by[0] / instrument_m, 2) : 0.0;
    doubt(offset, offset_fault, 1.0 / (1.0 + known));
    doubt(direction, direction_fault, 1.0);
    read.hidden_offset_rel = hidden_offset(scales, beam, offset, before);
  }
}

}  // namespace

std::optional<ReadScale> scale_by_range(std::span<const RangeReading> readings, const Beam& beam,
                                        std::span<const PathStep> path, std::span<const MapPoint> map) {
  auto [scales, other_log_scale] = scales_of(readings, beam, path, map);
  if (scales.empty()) return std::nullopt;
  const std::size_t num_given = scales.size();
  reject_far(scales);
  if (scales.size() < num_blocks) return std::nullopt;
  double roughness = 0.0;
  for (const BeamScale& each : scales) roughness += each.roughness / static_cast<double>(scales.size());
  const MeanScale mean = mean_of_blocks(scales);
  ReadScale read{std::exp(mean.log_scale), 0.0, scales.size(), num_given - scales.size()};
  // A curved surface is on one side of every plane through its points, by about as much as they are off it.
  read.sigma_rel = std::hypot(mean.sigma, sigma_by_beam(readings, beam, path, map), roughness);
  read.other_log_scale = other_log_scale;
  add_faults(scales, beam, roughness, read);
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

}  // namespace alidade
