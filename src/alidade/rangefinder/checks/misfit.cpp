#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/rangefinder/rangefinder.h"

namespace alidade {
namespace {

/// Residuals of ranges [m] and of spots [px], and how many there are.
struct Residuals {
  double sum_m2 = 0.0, num_m = 0.0, sum_px2 = 0.0, num_px = 0.0;

  void add(const ShotFit& fit) {
    if (std::isfinite(fit.residual_range_m)) sum_m2 += fit.residual_range_m * fit.residual_range_m, num_m += 1.0;
    if (fit.residual_px.allFinite()) sum_px2 += fit.residual_px.squaredNorm(), num_px += 2.0;
  }
  [[nodiscard]] double rms_m() const { return num_m > 0.0 ? std::sqrt(sum_m2 / num_m) : infinite; }
  [[nodiscard]] double rms_px() const { return num_px > 0.0 ? std::sqrt(2.0 * sum_px2 / num_px) : infinite; }
  [[nodiscard]] int spare() const { return static_cast<int>(num_m + num_px) - 5; }

  static constexpr double infinite = std::numeric_limits<double>::infinity();
};

/// How well a beam explains shots; 0 to spare where none does.
struct Explained {
  bool fits = false;    ///< Nearly all, by readings as a rangefinder's are.
  bool known = false;   ///< And the shots determine which beam.
  Residuals all, used;  ///< Of all shots; without those that were rejected.
  bool uses_all = false;
};

Explained explained(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
                    const RangefinderConfig& config) {
  constexpr double max_m = 0.05, max_of_range = 0.02;
  const RangefinderReport report = calibrate_rangefinder(shots, points_in_board, camera, config);
  double mean_m = 0.0;
  for (const Shot& shot : shots) mean_m += shot.range_m / static_cast<double>(shots.size());
  Explained by{.uses_all = report.shots_used == static_cast<int>(shots.size())};
  for (const ShotFit& fit : report.shots) {
    by.all.add(fit);
    if (fit.used) by.used.add(fit);
  }
  by.fits = 10 * report.shots_used >= 8 * static_cast<int>(shots.size()) && report.rms_range_m > 0.0 &&
            report.rms_range_m < std::min(max_m, max_of_range * mean_m);
  by.known = report.status == RangefinderReport::Status::converged && report.bound.sigma_origin_m < 0.1;
  return by;
}

constexpr double num_causes = 9.0;  // that are tried

/// Are residuals so much smaller that by chance none of the causes tried would do so once in a thousand tables?
/// Likelihood ratio of normal residuals, times the number of causes.
bool is_plain(double rms_before, const Explained& by, double rms) {
  constexpr double chance = 1e-3;
  return by.fits && by.known && by.all.spare() * std::log(rms_before / rms) > std::log(num_causes / chance);
}

bool is_cause(const Explained& by, const Explained& as_given) {
  return is_plain(as_given.all.rms_m(), by, by.all.rms_m());
}
bool is_cause_of_spots(const Explained& by, const Explained& as_given) {
  return is_plain(as_given.all.rms_px(), by, by.all.rms_px()) || (by.uses_all && is_cause(by, as_given));
}

/// The same where a beam explains the shots as they are too, as a scatter of some centimetres: all of them, as of shots
/// that disagree others may be rejected than before; by ranges and spots together, and not by chance once in ten
/// thousand tables.
bool explains_more(const Explained& by, const Explained& as_given) {
  constexpr double chance = 1e-4;
  if (!by.fits || !by.known || !by.uses_all || by.used.spare() < 1) return false;
  double ln_ratio = 0.0;
  if (by.used.num_m > 0.0) ln_ratio += by.used.num_m * std::log(as_given.used.rms_m() / by.used.rms_m());
  if (by.used.num_px > 0.0) ln_ratio += by.used.num_px * std::log(as_given.used.rms_px() / by.used.rms_px());
  return by.used.spare() / (by.used.num_m + by.used.num_px) * ln_ratio > std::log(num_causes / chance);
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

constexpr std::array<std::pair<double, const char*>, 4> units{
    {{0.001, "millimetres"}, {0.01, "centimetres"}, {0.0254, "inches"}, {0.3048, "feet"}}};

std::vector<Shot> in_unit(std::span<const Shot> shots, double metres) {
  std::vector<Shot> scaled(shots.begin(), shots.end());
  for (Shot& shot : scaled) {
    shot.range_m *= metres;
    if (shot.sigma_range_m) *shot.sigma_range_m *= metres;
  }
  return scaled;
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
                            const Camera& camera, const RangefinderConfig& config, bool is_solved) {
  constexpr std::size_t min_shots = 7;
  if (shots.size() < min_shots) return "";
  RangefinderConfig plain = config;
  if (plain.method == RangefinderMethod::spot) plain.method = RangefinderMethod::joint;  // spots know no metres
  plain.estimate_scale = plain.scale_by_need = false;
  plain.sigma_range_m.reset();
  plain.refine = Refine::beam;  // enough to compare beams by, and fast, as every job has it compared
  Explained as_given = explained(shots, points_in_board, camera, plain);
  if (!as_given.fits && config.refine != plain.refine) {
    plain.refine = config.refine;
    as_given = explained(shots, points_in_board, camera, plain);
  }
  // Shots that a beam explains are in metres; rows that lag and spots that are mirrored it may explain half.
  const auto explains = [&](std::span<const Shot> others, auto is_so) {
    const Explained by = explained(others, points_in_board, camera, plain);
    return is_solved || as_given.fits ? explains_more(by, as_given) : is_so(by, as_given);
  };
  if (explains(shifted(shots, 1), is_cause))
    return "each range belongs to the row before it: the order of the rows is shifted by one";
  if (explains(shifted(shots, -1), is_cause))
    return "each range belongs to the row after it: the order of the rows is shifted by one";
  if (!is_solved && !as_given.fits)
    for (const auto& [metres, name] : units)
      if (explains(in_unit(shots, metres), is_cause)) return std::string("the ranges are ") + name + ", not metres";
  if (plain.method == RangefinderMethod::plane) return "";
  for (const auto& [change, name] : changes_of_spots)
    if (explains(with_spots(shots, camera, change), is_cause_of_spots)) return name;
  return "";
}

}  // namespace alidade
