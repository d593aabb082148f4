#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {
namespace {

/// How well a beam explains shots; 0 to spare where none does.
struct Explained {
  bool fits = false;                                        ///< Nearly all, by readings as a rangefinder's are.
  bool known = false;                                       ///< And the shots determine which beam.
  double rms_m = std::numeric_limits<double>::infinity();   ///< Of the ranges of all shots.
  double rms_px = std::numeric_limits<double>::infinity();  ///< Of the spots of all shots.
  int spare = 0;                                            ///< Measurements beyond what the beam takes.
};

Explained explained(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
                    const RangefinderConfig& config) {
  constexpr double max_m = 0.05, max_of_range = 0.02;
  const RangefinderReport report = calibrate_rangefinder(shots, points_in_board, camera, config);
  double mean_m = 0.0, sum_m2 = 0.0, num = 0.0, sum_px2 = 0.0, num_spots = 0.0;
  for (const Shot& shot : shots) mean_m += shot.range_m / static_cast<double>(shots.size());
  Explained by{.spare = -5};
  for (const ShotFit& fit : report.shots) {
    by.spare += (std::isfinite(fit.residual_range_m) ? 1 : 0) + (fit.residual_px.allFinite() ? 2 : 0);
    if (fit.residual_px.allFinite()) sum_px2 += fit.residual_px.squaredNorm(), num_spots += 1.0;
    if (!std::isfinite(fit.residual_range_m)) continue;
    sum_m2 += fit.residual_range_m * fit.residual_range_m;
    num += 1.0;
  }
  if (num > 0.0) by.rms_m = std::sqrt(sum_m2 / num);
  if (num_spots > 0.0) by.rms_px = std::sqrt(sum_px2 / num_spots);
  by.fits = 10 * report.shots_used >= 8 * static_cast<int>(shots.size()) && report.rms_range_m > 0.0 &&
            report.rms_range_m < std::min(max_m, max_of_range * mean_m);
  by.known = report.status == RangefinderReport::Status::converged && report.bound.sigma_origin_m < 0.1;
  return by;
}

/// Are residuals so much smaller that by chance none of the causes tried would do so once in a thousand tables?
/// Likelihood ratio of normal residuals, times the number of causes.
bool is_plain(double rms_before, const Explained& by, double rms) {
  constexpr double num_causes = 9.0, chance = 1e-3;
  return by.fits && by.known && by.spare * std::log(rms_before / rms) > std::log(num_causes / chance);
}

bool is_cause(const Explained& by, const Explained& as_given) { return is_plain(as_given.rms_m, by, by.rms_m); }
bool is_cause_of_spots(const Explained& by, const Explained& as_given) {
  return is_plain(as_given.rms_px, by, by.rms_px);
}

/// The ranges of one row after (1) or before (−1); the row without one is rejected.
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

using ChangeOfSpot = Eigen::Vector2d (*)(const Eigen::Vector2d&, const Camera&);

/// Spots as another order of the columns, or a mirrored image, would have them.
std::vector<Shot> with_spots(std::span<const Shot> shots, const Camera& camera, ChangeOfSpot changed) {
  std::vector<Shot> moved(shots.begin(), shots.end());
  for (Shot& shot : moved)
    if (shot.spot) shot.spot->px = changed(shot.spot->px, camera);
  return moved;
}

constexpr std::array<std::pair<ChangeOfSpot, const char*>, 3> changes_of_spots{{
    {[](const Eigen::Vector2d& px, const Camera&) -> Eigen::Vector2d { return px.reverse(); },
     "u and v of the spots are exchanged"},
    {[](const Eigen::Vector2d& px, const Camera& camera) -> Eigen::Vector2d {
       return {camera.width_px - 1.0 - px.x(), px.y()};
     },
     "the spots are mirrored: u is counted from the right"},
    {[](const Eigen::Vector2d& px, const Camera& camera) -> Eigen::Vector2d {
       return {px.x(), camera.height_px - 1.0 - px.y()};
     },
     "the spots are mirrored: v is counted from below"},
}};

}  // namespace

std::string cause_of_misfit(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                            const Camera& camera, const RangefinderConfig& config) {
  constexpr std::size_t min_shots = 7;
  if (shots.size() < min_shots) return "";
  RangefinderConfig plain = config;
  if (plain.method == RangefinderMethod::spot) plain.method = RangefinderMethod::joint;  // spots know no metres
  plain.estimate_scale = plain.scale_by_need = false;
  plain.sigma_range_m.reset();
  const Explained as_given = explained(shots, points_in_board, camera, plain);
  if (as_given.fits) return "";  // nothing is amiss with them: what they do not determine they do not claim
  const auto explains = [&](std::span<const Shot> others) {
    return is_cause(explained(others, points_in_board, camera, plain), as_given);
  };
  if (explains(shifted(shots, 1)))
    return "each range belongs to the row before it: the order of the rows is shifted by one";
  if (explains(shifted(shots, -1)))
    return "each range belongs to the row after it: the order of the rows is shifted by one";
  constexpr std::array<std::pair<double, const char*>, 4> units{
      {{0.001, "millimetres"}, {0.01, "centimetres"}, {0.0254, "inches"}, {0.3048, "feet"}}};
  for (const auto& [metres, name] : units) {
    std::vector<Shot> scaled(shots.begin(), shots.end());
    for (Shot& shot : scaled) {
      shot.range_m *= metres;
      if (shot.sigma_range_m) *shot.sigma_range_m *= metres;
    }
    if (explains(scaled)) return std::string("the ranges are ") + name + ", not metres";
  }
  for (const auto& [change, name] : changes_of_spots)
    if (is_cause_of_spots(explained(with_spots(shots, camera, change), points_in_board, camera, plain), as_given))
      return name;
  return "";
}

}  // namespace alidade
