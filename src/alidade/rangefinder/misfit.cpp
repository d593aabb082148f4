#include <array>
#include <utility>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {
namespace {

/// A beam that explains nearly all shots, by readings as a rangefinder's are.
bool explains(const std::vector<Shot>& shots, std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
              const RangefinderConfig& config) {
  constexpr double most_m = 0.05, most_of_range = 0.02;
  const RangefinderReport report = calibrate_rangefinder(shots, points_in_board, camera, config);
  double mean_m = 0.0;
  for (const Shot& shot : shots) mean_m += shot.range_m / static_cast<double>(shots.size());
  return report.status == RangefinderReport::Status::converged && report.bound.sigma_origin_m < 0.1 &&
         10 * report.shots_used >= 8 * static_cast<int>(shots.size()) && report.rms_range_m > 0.0 &&
         report.rms_range_m < std::min(most_m, most_of_range * mean_m);
}

/// The ranges of one row after (1) or before (−1); the row without one is left out.
std::vector<Shot> shifted(std::span<const Shot> shots, int by) {
  std::vector<Shot> moved;
  for (std::size_t i = 0; i < shots.size(); ++i) {
    const auto from = static_cast<std::ptrdiff_t>(i) + by;
    if (from < 0 || from >= static_cast<std::ptrdiff_t>(shots.size())) continue;
    moved.push_back(shots[i]);
    moved.back().range_m = shots[static_cast<std::size_t>(from)].range_m;
    moved.back().sigma_range_m = shots[static_cast<std::size_t>(from)].sigma_range_m;
  }
  return moved;
}

}  // namespace

std::string cause_of_misfit(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                            const Camera& camera, const RangefinderConfig& config) {
  constexpr std::size_t least_shots = 7;
  if (shots.size() < least_shots) return "";
  RangefinderConfig plain = config;
  if (plain.method == RangefinderMethod::spot) plain.method = RangefinderMethod::joint;  // spots know no metres
  plain.estimate_scale = plain.scale_by_need = false;
  plain.range_noise.reset();
  if (explains(shifted(shots, 1), points_in_board, camera, plain))
    return "each range belongs to the row before it: the order of the rows is shifted by one";
  if (explains(shifted(shots, -1), points_in_board, camera, plain))
    return "each range belongs to the row after it: the order of the rows is shifted by one";
  constexpr std::array<std::pair<double, const char*>, 4> units{
      {{0.001, "millimetres"}, {0.01, "centimetres"}, {0.0254, "inches"}, {0.3048, "feet"}}};
  for (const auto& [metres, name] : units) {
    std::vector<Shot> scaled(shots.begin(), shots.end());
    for (Shot& shot : scaled) {
      shot.range_m *= metres;
      if (shot.sigma_range_m) *shot.sigma_range_m *= metres;
    }
    if (explains(scaled, points_in_board, camera, plain)) return std::string("the ranges are ") + name + ", not metres";
  }
  return "";
}

}  // namespace alidade
