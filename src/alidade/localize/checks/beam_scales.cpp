#include "alidade/localize/checks/beam_scales.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <functional>
#include <optional>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/localize/checks/beam_surfaces.h"
#include "alidade/localize/checks/scale_readings.h"

namespace alidade {
namespace {

/// Choice of the surface that a beam meets.
enum class SurfaceBy {
  nearest,  ///< The plane through the nearest points.
  around,   ///< Any plane through coplanar points all around the beam; if there are several, one behind the other,
            ///< the readings together decide.
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
  // n·X = c in units; n·X = s c in metres for the point where the beam hits it.
  const double scale = of_hit / to_plane;
  if (!(scale > 0.0) || !std::isfinite(scale)) return std::nullopt;
  const Eigen::RowVectorXd of_params = surface.normal.transpose() * J_point_beam(beam, range_m) / to_plane;
  return BeamScale{std::log(scale), surface.roughness / distance, of_beam / to_plane,
                   of_params.segment<2>(beam_direction_param).transpose()};
}

/// Metres per unit where the beam hits a plane through points near it, for each such plane, with its derivative with
/// respect to the reading's time: the surface stays fixed.
std::vector<BeamScale> scales_at(const RangeData& data, const RangeReading& reading, SurfaceBy by) {
  constexpr double step_s = 0.05;
  const auto pose = pose_at(data.path, reading.t_s);
  if (!pose) return {};
  const Rigid3 cam_from_world = pose->inverse();
  std::vector<Eigen::Vector3d> points_in_cam;
  points_in_cam.reserve(data.map.size());
  for (const MapPoint& point : data.map) points_in_cam.push_back(cam_from_world * point.point_in_world);
  const auto before = pose_at(data.path, reading.t_s - step_s), after = pose_at(data.path, reading.t_s + step_s);
  std::vector<BeamScale> scales;
  for (const BeamSurface& surface : surfaces_of(point_at(data.beam, reading.range_m), points_in_cam, by)) {
    auto scale = scale_on(surface, data.beam, reading.range_m);
    if (!scale) continue;
    const auto seen_from = [&](const Rigid3& other) {
      const Rigid3 other_from_cam = other.inverse() * *pose;
      return scale_on({other_from_cam.rotation * surface.normal, other_from_cam * surface.middle, surface.roughness},
                      data.beam, reading.range_m);
    };
    const auto one = before ? seen_from(*before) : std::nullopt, other = after ? seen_from(*after) : std::nullopt;
    scale->met_in_world = *pose * (std::exp(-scale->log_scale) * point_at(data.beam, reading.range_m));
    if (one && other) scale->of_time = (std::exp(other->log_scale) - std::exp(one->log_scale)) / (2.0 * step_s);
    scales.push_back(*scale);
  }
  return scales;
}

std::optional<BeamScale> scale_at(const RangeData& data, const RangeReading& reading) {
  const std::vector<BeamScale> scales = scales_at(data, reading, SurfaceBy::nearest);
  return scales.empty() ? std::nullopt : std::optional(scales.front());
}

/// Derivative of ln scale with respect to the beam's parameters: median over the readings, since a displaced beam may
/// hit between other points.
BeamVector of_beam_params(const RangeData& data) {
  constexpr double step = 1e-5;  // m, rad or relative
  std::array<std::vector<double>, num_beam_params> slopes;
  for (const RangeReading& reading : data.readings) {
    const auto scale = scale_at(data, reading);
    if (!scale) continue;
    for (int k = 0; k < num_beam_params; ++k) {
      const RangeData with_beam{data.readings, data.beam.retract(step * BeamVector::Unit(k)), data.path, data.map};
      const auto moved = scale_at(with_beam, reading);
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

/// For each reading the scale on which most of the others agree: the mode of a kernel density. Empty if too few agree:
/// the beam may have met none of these surfaces, for instance inside a frame of points.
std::optional<AgreeingScales> agreeing(std::span<const std::vector<BeamScale>> of_readings) {
  constexpr double width = 0.01, apart = 3.0, half = 0.5, enough = 0.6;
  const auto nearest = [](const std::vector<BeamScale>& scales, double log_scale) {
    return *std::ranges::min_element(scales, {},
                                     [&](const BeamScale& each) { return std::abs(each.log_scale - log_scale); });
  };
  std::vector<std::pair<double, double>> supports;  // support and log scale
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

/// The scales of each reading that has a surface, in order of time.
std::vector<std::vector<BeamScale>> scales_by(SurfaceBy by, const RangeData& data) {
  std::vector<std::vector<BeamScale>> of_readings;
  for (const RangeReading& reading : data.readings) {
    auto scales = scales_at(data, reading, by);
    if (!scales.empty()) of_readings.push_back(std::move(scales));
  }
  return of_readings;
}

}  // namespace

double sigma_by_beam(const RangeData& data) {
  constexpr double ordinary_scale = 0.005;
  if (!(data.beam.cov.diagonal().maxCoeff() > 0.0)) return ordinary_scale;
  const BeamVector along = of_beam_params(data);
  return std::sqrt(std::max(along.dot(data.beam.cov * along), 0.0));
}

AgreeingScales scales_of(const RangeData& data) {
  constexpr std::size_t enough = 3 * num_blocks;
  const auto around = scales_by(SurfaceBy::around, data);
  if (around.size() >= enough)
    if (auto agree = agreeing(around)) return *std::move(agree);
  AgreeingScales nearest;
  for (const std::vector<BeamScale>& each : scales_by(SurfaceBy::nearest, data)) nearest.scales.push_back(each.front());
  if (nearest.scales.size() < enough) nearest.scales.clear();
  return nearest;
}

}  // namespace alidade
