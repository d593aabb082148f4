#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/similarity.h"
#include "alidade/localize/checks/odometry_steps.h"
#include "alidade/localize/checks/scale_readings.h"

// Odometry's scale: its clock, its filter, and whether it fits the path at all.

namespace alidade {
namespace {

/// Distance of each reading from the median of its neighbours, after subtraction of the path's motion; 0 outside the
/// path.
std::vector<double> away_from_neighbours(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  constexpr std::size_t each_side = 3;
  std::vector<Eigen::Vector3d> of_path, of_vehicle;
  std::vector<std::size_t> at;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const auto pose = pose_at(path, readings[i].t_s);
    if (!pose) continue;
    of_path.push_back(pose->translation);
    of_vehicle.push_back(readings[i].position_m);
    at.push_back(i);
  }
  const auto there = aligned(of_path, of_vehicle, false);
  if (!there || at.size() <= 2 * each_side) return {};
  for (std::size_t i = 0; i < at.size(); ++i) of_vehicle[i] -= there->scale * (there->b_from_a.rotation * of_path[i]);
  std::vector<double> away(readings.size(), 0.0);
  for (std::size_t i = 0; i < at.size(); ++i) {
    const std::size_t first = std::min(i > each_side ? i - each_side : 0, at.size() - 1 - 2 * each_side);
    Eigen::Vector3d middle;
    for (int axis = 0; axis < 3; ++axis) {
      std::vector<double> around;
      for (std::size_t k = first; k <= first + 2 * each_side; ++k)
        if (k != i) around.push_back(of_vehicle[k][axis]);
      middle[axis] = median_of(std::move(around));
    }
    away[at[i]] = (of_vehicle[i] - middle).norm();
  }
  return away;
}

/// Removes readings far from their neighbours, whatever drifts: a lifted wheel, a corrupted message. A lasting jump is
/// not removed.
std::vector<OdometryReading> without_far(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  constexpr int rounds = 2;
  constexpr double far = 4.0;  // over the median
  std::vector<OdometryReading> near(readings.begin(), readings.end());
  for (int round = 0; round < rounds; ++round) {
    const std::vector<double> away = away_from_neighbours(near, path);
    if (away.empty()) return near;
    const double limit = far * median_of(away) + 1e-9;
    std::size_t next = 0;
    std::erase_if(near, [&](const OdometryReading&) { return away[next++] > limit; });
  }
  return near;
}

/// Positions at the times of the readings, for a clock that is late by `late_s`.
std::vector<Place> places_of(std::span<const OdometryReading> readings, double late_s, std::span<const PathStep> path) {
  std::vector<Place> places;
  for (std::size_t i = 0; i < readings.size(); ++i) {
    const double t_s = readings[i].t_s - late_s;
    const auto pose = pose_at(path, t_s);
    if (!pose) continue;
    Place place{pose->translation, readings[i].position_m, 0.0, position_cov_at(path, t_s).trace(), i};
    if (!places.empty()) place.way_m = places.back().way_m + (place.of_path - places.back().of_path).norm();
    places.push_back(place);
  }
  return places;
}

/// Sums of squares over a part of the places.
struct PartFit {
  double extent_m2 = 0.0;   ///< Of the vehicle's positions, about their mean.
  double of_path_m2 = 0.0;  ///< Part of the residuals that the path's σ explains.
};

/// Residuals of a similarity fit to a part, in metres; along a line, those of the distances on it.
std::vector<Eigen::Vector3d> left_over(std::span<const Place> places, PartFit& part) {
  std::vector<Eigen::Vector3d> of_path, of_vehicle, left;
  Eigen::Vector3d middle_of_path = Eigen::Vector3d::Zero(), middle = Eigen::Vector3d::Zero();
  for (const Place& place : places) {
    of_path.push_back(place.of_path);
    of_vehicle.push_back(place.of_vehicle);
    middle_of_path += place.of_path / static_cast<double>(places.size());
    middle += place.of_vehicle / static_cast<double>(places.size());
  }
  const auto there = aligned(of_path, of_vehicle, false);
  const Eigen::Vector3d along_path = (of_path.back() - of_path.front()).normalized();
  const Eigen::Vector3d along = (of_vehicle.back() - of_vehicle.front()).normalized();
  double products = 0.0, squares = 0.0, extent_of_path = 0.0, path_variances = 0.0;
  for (const Place& place : places) {
    const double x = along_path.dot(place.of_path - middle_of_path);
    products += x * along.dot(place.of_vehicle - middle);
    squares += x * x;
    part.extent_m2 += (place.of_vehicle - middle).squaredNorm();
    extent_of_path += (place.of_path - middle_of_path).squaredNorm();
    path_variances += place.path_variance;
  }
  if (extent_of_path > 0.0) part.of_path_m2 = path_variances * part.extent_m2 / extent_of_path;
  const double scale = squares > 0.0 ? products / squares : 0.0;
  for (const Place& place : places)
    left.push_back(there ? place.of_vehicle -
                               (there->scale * (there->b_from_a.rotation * place.of_path) + there->b_from_a.translation)
                         : Eigen::Vector3d((along.dot(place.of_vehicle - middle) -
                                            scale * along_path.dot(place.of_path - middle_of_path)) *
                                           along));
  return left;
}

/// Fit of a path to odometry, separately for each fifth of the way: odometry's frame rotates with its errors.
struct WayFit {
  double misfit_m2 = std::numeric_limits<double>::infinity();  ///< Mean squared residual.
  double persistent = 1.0;     ///< RMS of its persistent part, over that of the vehicle's positions.
  double num_independent = 1;  ///< Effective number of independent readings.
};

WayFit way_fit(std::span<const Place> places) {
  constexpr std::size_t most_parts = 5, readings_each = 10, enough = 5;
  const std::size_t num_parts = std::clamp(places.size() / readings_each, std::size_t{1}, most_parts);
  double extent = 0.0, alike = 0.0, persistent = 0.0, squares = 0.0, num = 0.0;
  const auto part_of = [&](std::size_t i) {
    const double share = places[i].way_m / places.back().way_m;
    return std::min(static_cast<std::size_t>(static_cast<double>(num_parts) * share), num_parts - 1);
  };
  for (std::size_t begin = 0, end = 0; begin < places.size(); begin = end) {
    while (end < places.size() && part_of(end) == part_of(begin)) ++end;
    if (end - begin < enough) continue;
    PartFit part;
    const std::vector<Eigen::Vector3d> left = left_over(places.subspan(begin, end - begin), part);
    extent += part.extent_m2;
    const double here = static_cast<double>(left.size());
    // seven parameters, three coordinates per place
    const double freed = 3.0 * here / (3.0 * here - 7.0);
    const double of_part = here * freed * persistent_square(left);
    alike += of_part;
    persistent += std::max(of_part - part.of_path_m2, 0.0);
    for (const Eigen::Vector3d& each : left) squares += freed * each.squaredNorm();
    num += here;
  }
  if (!(extent > 0.0)) return {};
  const double correlation = squares > 0.0 ? std::clamp(alike / squares, 0.0, 0.98) : 0.0;
  return {squares / num, std::sqrt(persistent / extent), num * (1.0 - correlation) / (1.0 + correlation)};
}

/// Relative distance of a path from its best plane, over all of it: planar odometry does not measure
/// that.
double out_of_plane(std::span<const Place> places) {
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Place& place : places) middle += place.of_path / static_cast<double>(places.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Place& place : places) scatter += (place.of_path - middle) * (place.of_path - middle).transpose();
  const Eigen::Vector3d squares = symmetric_eigen3(scatter).values;
  return squares.sum() > 0.0 ? std::sqrt(std::max(squares[0], 0.0) / squares.sum()) : 0.0;
}

/// Delay of odometry's clock, if it explains significantly more than none: the minimum of a parabola through the best
/// of a grid.
double clock_by(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  constexpr double step_s = 0.05, fine_s = 0.015, clear = 12.0;  // of χ², 3.5σ
  constexpr int most = 20;
  std::array<WayFit, 2 * most + 1> fits;
  for (int i = -most; i <= most; ++i) {
    const std::vector<Place> places = places_of(readings, step_s * i, path);
    if (!places.empty() && places.back().way_m > 0.0) fits[static_cast<std::size_t>(i + most)] = way_fit(places);
  }
  const auto best = static_cast<std::size_t>(std::ranges::min_element(fits, {}, &WayFit::misfit_m2) - fits.begin());
  if (best == 0 || best + 1 == fits.size()) return 0.0;
  const double before = fits[best - 1].misfit_m2, least = fits[best].misfit_m2, after = fits[best + 1].misfit_m2;
  if (!std::isfinite(before + after)) return 0.0;
  if (!(fits[most].misfit_m2 - least > clear * least / fits[best].num_independent)) return 0.0;
  const auto bottom = [](double left, double middle, double right) {
    const double curve = left - 2.0 * middle + right;
    return curve > 0.0 ? std::clamp(0.5 * (left - right) / curve, -1.0, 1.0) : 0.0;
  };
  const double near_s = step_s * (static_cast<double>(best) - most + bottom(before, least, after));
  const auto misfit_at = [&](double late_s) { return way_fit(places_of(readings, late_s, path)).misfit_m2; };
  return near_s + fine_s * bottom(misfit_at(near_s - fine_s), misfit_at(near_s), misfit_at(near_s + fine_s));
}

/// Interpolation makes errors of the path smaller between two frames than at one, which attracts the clock: uses the
/// path without jitter, if that fits better.
double clock_of(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  const double late_s = clock_by(readings, path);
  if (late_s == 0.0) return 0.0;
  const std::vector<PathStep> smooth = without_jitter(path, jitter_s);
  const double smooth_s = clock_by(readings, smooth);
  const double misfit = way_fit(places_of(readings, late_s, path)).misfit_m2;
  return smooth_s != 0.0 && way_fit(places_of(readings, smooth_s, smooth)).misfit_m2 < misfit ? smooth_s : late_s;
}

/// Time constant and clock of odometry, the fit of the filtered path, and its scale.
struct Followed {
  double tau_s = 0.0, late_s = 0.0;
  WayFit fit;
  StepScale scale;
  std::vector<Place> places;
};

std::optional<Followed> followed(std::span<const OdometryReading> readings, double tau_s, double late_s,
                                 std::span<const PathStep> shown) {
  Followed one{.tau_s = tau_s, .late_s = late_s, .places = places_of(readings, late_s, shown)};
  const auto scale = scale_by_steps(one.places);
  if (!scale) return std::nullopt;
  one.scale = *scale;
  one.fit = way_fit(one.places);
  return std::isfinite(one.fit.misfit_m2) ? std::optional(std::move(one)) : std::nullopt;
}

/// Candidate filters with clocks: a low-pass filter delays the way by its time constant, as a late clock does, and
/// rounds off its corners, as no clock does. One of higher order is like one with a delay; a sampled one, whose newest
/// sample counts at once, is like one that is early by half a sample interval. Skipped if the clock is right and
/// residuals are not autocorrelated.
std::vector<Followed> filters_of(std::span<const OdometryReading> readings, const Followed& clock,
                                 std::span<const PathStep> path) {
  constexpr double first_s = 0.05, last_s = 1.5, ratio = 1.15, step_s = 0.05, alike = 3.0;
  constexpr int most = 6;
  std::vector<Followed> filters;
  const double every_s =
      (readings.back().t_s - readings.front().t_s) / static_cast<double>(std::max<std::size_t>(readings.size() - 1, 1));
  const double earliest_s = -std::min(0.5 * every_s, most * step_s);
  const auto num = static_cast<double>(clock.places.size());
  if (clock.late_s == 0.0 && num < alike * clock.fit.num_independent) return filters;
  for (double tau_s = first_s; tau_s < last_s; tau_s *= ratio) {
    const std::vector<PathStep> shown = filtered(path, tau_s);
    for (int k = 0; k <= most; ++k)
      if (auto one = followed(readings, tau_s, earliest_s + k * step_s, shown)) filters.push_back(*std::move(one));
  }
  return filters;
}

/// The fit with a clock alone, or with a filter if that explains significantly more; the scale is the mean over all,
/// weighted by likelihood, and their scatter is included in σ.
Followed averaged(Followed clock, const std::vector<Followed>& filters) {
  constexpr double clear = 12.0;  // of χ², 3.5σ
  if (filters.empty()) return clock;
  const Followed& best =
      *std::ranges::min_element(filters, {}, [](const Followed& each) { return each.fit.misfit_m2; });
  const double least = std::min(best.fit.misfit_m2, clock.fit.misfit_m2), num = best.fit.num_independent;
  const auto chi2_of = [&](const Followed& each) { return num * (each.fit.misfit_m2 / least - 1.0); };
  double weights = 0.0, sum = 0.0, squares = 0.0;
  const auto add = [&](const Followed& each) {
    const double weight = std::exp(-0.5 * chi2_of(each)), log = each.scale.log;
    weights += weight, sum += weight * log, squares += weight * log * log;
  };
  for (const Followed& each : filters) add(each);
  add(clock);
  Followed chosen = chi2_of(clock) > clear ? best : std::move(clock);
  chosen.scale.log = sum / weights;
  chosen.scale.sigma =
      std::hypot(chosen.scale.sigma, std::sqrt(std::max(squares / weights - chosen.scale.log * chosen.scale.log, 0.0)));
  return chosen;
}

/// The best fit, with clock and filter estimated.
std::optional<Followed> followed_best(std::span<const OdometryReading> readings, std::span<const PathStep> path) {
  auto clock = followed(readings, 0.0, clock_of(readings, path), path);
  if (!clock) return std::nullopt;
  const auto smooth = followed(readings, 0.0, clock->late_s, without_jitter(path, jitter_s));
  if (smooth && smooth->fit.misfit_m2 < clock->fit.misfit_m2) clock->fit = smooth->fit;
  const std::vector<Followed> filters = filters_of(readings, *clock, path);
  return averaged(*std::move(clock), filters);
}

/// Readings with the slip removed: later ones are shifted back by the same amount.
std::vector<OdometryReading> without_slip(std::span<const OdometryReading> readings, std::span<const Place> places,
                                          const Slip& slip) {
  std::vector<OdometryReading> mended(readings.begin(), readings.end());
  Eigen::Vector3d excess = Eigen::Vector3d::Zero();
  std::size_t step = slip.begin;
  for (std::size_t i = 0; i < mended.size(); ++i) {
    while (step < slip.end && places[step + 1].reading <= i) excess += slip.excess[step++ - slip.begin];
    mended[i].position_m -= excess;
  }
  return mended;
}

/// The best fit with slips removed, as long as the rest then fits significantly better.
std::optional<Followed> followed_without_slips(std::vector<OdometryReading>& readings, std::span<const PathStep> path,
                                               ReadScale& read) {
  constexpr int most = 3;
  constexpr double better = 0.8;
  auto found = followed_best(readings, path);
  double longest = 0.0;
  for (int i = 0; found && i < most; ++i) {
    const auto slip = slip_of(found->places);
    if (!slip) break;
    std::vector<OdometryReading> mended = without_slip(readings, found->places, *slip);
    auto again = followed_best(mended, path);
    if (!again || !(again->fit.misfit_m2 < better * found->fit.misfit_m2)) break;
    const double from_s = readings[found->places[slip->begin].reading].t_s,
                 to_s = readings[found->places[slip->end].reading].t_s;
    if (to_s - from_s > longest)
      longest = to_s - from_s, read.slip_from_s = from_s, read.slip_to_s = to_s, read.slip_ratio = slip->ratio;
    readings = std::move(mended);
    found = std::move(again);
  }
  return found;
}

}  // namespace

std::optional<ReadScale> scale_by_odometry(std::span<const OdometryReading> given, double sigma_rel,
                                           std::span<const PathStep> path) {
  std::vector<OdometryReading> readings = without_far(given, path);
  const std::size_t num_far = given.size() - readings.size();
  ReadScale read;
  const auto found = followed_without_slips(readings, path, read);
  if (!found) return std::nullopt;
  const bool is_in_plane = std::ranges::all_of(
      readings, [&](const OdometryReading& each) { return each.position_m.z() == readings.front().position_m.z(); });
  const double lost = is_in_plane ? out_of_plane(found->places) : 0.0;
  read.scale = std::exp(found->scale.log);
  read.sigma_rel = std::hypot(std::hypot(found->scale.sigma, found->fit.persistent, sigma_rel), lost);
  read.num_used = found->scale.num_used;
  read.num_rejected = found->scale.num_given - found->scale.num_used + num_far;
  read.late_s = found->late_s;
  read.lag_s = found->tau_s;
  constexpr double useless = 0.2;
  return read.sigma_rel < useless ? std::optional(read) : std::nullopt;
}

}  // namespace alidade
