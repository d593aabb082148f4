#include "alidade/rangefinder/checks/line_offset.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <vector>

namespace alidade {
namespace {

/// σ of the beam's distance from the camera's centre: along u, the way to the line, the origin moves it by itself, the
/// direction by how far away it passes.
double sigma_of_offset_m(const Beam& beam) {
  const double along_m = beam.origin_in_cam.dot(beam.direction_in_cam);
  const Eigen::Vector3d to_line = beam.origin_in_cam - along_m * beam.direction_in_cam;
  if (!(to_line.norm() > 0.0)) return 0.0;
  const Eigen::Vector3d u = to_line.normalized();
  Eigen::Matrix<double, 1, 7> J;
  J << u.transpose(), -along_m * u.transpose(), 0.0;
  return std::sqrt((J * embedded_covariance(beam) * J.transpose())[0]);
}

constexpr double near_centre_m = 0.015;

/// By the spots alone: a ray's x/z and y/z move with 1/range by how far the line passes. Stated where no beam is: with
/// all spots at one position any origin along their ray will do. None where they do not determine it, either.
std::optional<LineOffset> offset_by_spots(const RangefinderReport& report, std::span<const Shot> shots) {
  std::vector<Eigen::Vector3d> seen;  // x/z, y/z, 1/range
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (std::size_t i = 0; i < shots.size() && i < report.shots.size(); ++i) {
    const auto ray = report.shots[i].used && shots[i].spot ? unproject(report.camera, shots[i].spot->px) : std::nullopt;
    if (!ray || !(ray->z() > 0.0)) continue;
    seen.emplace_back(ray->x() / ray->z(), ray->y() / ray->z(), 1.0 / shots[i].range_m);
    mean += seen.back();
  }
  if (seen.size() < 4) return std::nullopt;
  mean /= static_cast<double>(seen.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& s : seen) scatter += (s - mean) * (s - mean).transpose();
  if (!(scatter(2, 2) > 0.0)) return std::nullopt;
  const Eigen::Vector2d slope = scatter.block<2, 1>(0, 2) / scatter(2, 2);
  const double left = scatter.topLeftCorner<2, 2>().trace() - slope.squaredNorm() * scatter(2, 2);
  const double variance = std::max(0.0, left) / (2.0 * static_cast<double>(seen.size()) - 4.0);
  const LineOffset offset{slope.norm(), std::sqrt(variance / scatter(2, 2))};
  return 3.0 * offset.sigma_m < near_centre_m ? std::optional(offset) : std::nullopt;
}

}  // namespace

LineOffset line_offset(const RangefinderReport& report, std::span<const Shot> shots) {
  const LineOffset solved{report.bound.offset_m, sigma_of_offset_m(report.beam)};
  if (3.0 * solved.sigma_m < near_centre_m) return solved;
  return offset_by_spots(report, shots).value_or(solved);
}

bool passes_the_centre(const LineOffset& offset) {
  constexpr double min_m = 0.002;  // nearer, no spot moves by what it could be measured with
  return offset.value_m < near_centre_m && offset.value_m < std::max(min_m, 3.0 * offset.sigma_m);
}

}  // namespace alidade
