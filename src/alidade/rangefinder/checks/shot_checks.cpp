#include "alidade/rangefinder/checks/shot_checks.h"

#include <algorithm>
#include <limits>
#include <numeric>
#include <random>

#include "alidade/board/board_pose.h"
#include "alidade/rangefinder/rangefinder.h"

namespace alidade {
namespace {

constexpr double not_there = std::numeric_limits<double>::quiet_NaN();

std::vector<std::size_t> used_shots(const RangefinderReport& report) {
  std::vector<std::size_t> used;
  for (std::size_t i = 0; i < report.shots.size(); ++i)
    if (report.shots[i].used) used.push_back(i);
  return used;
}

/// The config of a part of the shots: the noise estimated from all of them, and no search for outliers.
RangefinderConfig config_of_part(const RangefinderConfig& config, const RangefinderReport& report) {
  RangefinderConfig part = config;
  part.reject_outliers = false;
  part.sigma_spot_px = report.sigma_spot_px > 0.0 ? std::optional(report.sigma_spot_px) : config.sigma_spot_px;
  part.set_range_noise(report.beam.noise);
  return part;
}

/// Plane of the board that a shot hit, from its own measurements alone.
std::optional<Plane> plane_of_shot(const Shot& shot, const Camera& camera,
                                   std::span<const Eigen::Vector3d> points_in_board) {
  if (shot.board) {
    const auto fit = fit_board_pose(camera, *shot.board, points_in_board);
    return fit ? std::optional(plane_of(fit->pose.cam_from_board)) : std::nullopt;
  }
  if (shot.pose) return plane_of(shot.pose->cam_from_board);
  return shot.plane;
}

LeftOutShot predicted(std::size_t index, const Shot& shot, const RangefinderReport& others,
                      std::span<const Eigen::Vector3d> points_in_board) {
  LeftOutShot left{index, not_there, Eigen::Vector2d::Constant(not_there)};
  const Beam& beam = others.beam;
  if (const auto plane = plane_of_shot(shot, others.camera, points_in_board)) {
    const double along = plane->normal_in_cam.dot(beam.direction_in_cam) * beam.scale;
    left.residual_range_m = -(plane->d_m + plane->normal_in_cam.dot(beam.origin_in_cam)) / along - shot.range_m;
  }
  if (shot.spot) {
    const auto px = project(others.camera, point_at(beam, shot.range_m));
    if (px) left.residual_px = *px - shot.spot->px;
  }
  return left;
}

}  // namespace

std::vector<CountedSigma> sigma_by_count(std::span<const Shot> shots, const RangefinderReport& report,
                                         std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
                                         const RangefinderConfig& config, const Progress& progress) {
  constexpr std::size_t max_counts = 20;
  std::vector<std::size_t> order = used_shots(report);
  std::mt19937_64 draw(config.seed);
  std::shuffle(order.begin(), order.end(), draw);
  const RangefinderConfig part_config = config_of_part(config, report);
  const std::size_t every = std::max<std::size_t>(1, order.size() / max_counts);
  std::vector<Shot> part;
  std::vector<CountedSigma> counted;
  for (std::size_t n = 0; n < order.size(); ++n) {
    report_progress(progress, "counting shots", n, order.size());
    part.push_back(shots[order[n]]);
    if (n < 1 || (n + 1 != order.size() && (n + 1) % every != 0)) continue;
    const RangefinderReport fit = calibrate_rangefinder(part, points_in_board, camera, part_config);
    if (fit.status != RangefinderReport::Status::converged) continue;
    counted.push_back({.num_shots = static_cast<int>(n + 1),
                       .sigma_origin_m = fit.bound.sigma_origin_m,
                       .sigma_direction_rad = fit.bound.sigma_direction_rad,
                       .bound_origin_m = std::sqrt(fit.bound.cov.topLeftCorner<3, 3>().trace()),
                       .bound_direction_rad =
                           std::sqrt(fit.bound.cov.block<2, 2>(beam_direction_param, beam_direction_param).trace())});
  }
  return counted;
}

std::vector<LeftOutShot> leave_one_out(std::span<const Shot> shots, const RangefinderReport& report,
                                       std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
                                       const RangefinderConfig& config, const Progress& progress) {
  constexpr std::size_t most = 60;
  const std::vector<std::size_t> used = used_shots(report);
  const RangefinderConfig part_config = config_of_part(config, report);
  const std::size_t every = used.size() / most + 1;
  std::vector<LeftOutShot> left;
  for (std::size_t k = 0; k < used.size(); k += every) {
    report_progress(progress, "leaving one shot out", k, used.size());
    std::vector<Shot> others;
    for (const std::size_t i : used)
      if (i != used[k]) others.push_back(shots[i]);
    const RangefinderReport fit = calibrate_rangefinder(others, points_in_board, camera, part_config);
    if (fit.status != RangefinderReport::Status::converged) continue;
    left.push_back(predicted(used[k], shots[used[k]], fit, points_in_board));
  }
  return left;
}

}  // namespace alidade
