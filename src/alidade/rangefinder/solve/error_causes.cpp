#include "alidade/rangefinder/solve/error_causes.h"

#include <algorithm>
#include <cmath>

#include "alidade/estimation/innovation.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

/// What a cause does to a shot's three errors by its own size: of its reading [m] and spot [px], or of its board [m].
using Share = Eigen::Matrix<double, 3, Eigen::Dynamic, 0, 3, 3>;

/// How many residuals there are, and from how many of them each σ was estimated.
struct Measured {
  double rows = 0.0, of_ranges = 0.0, of_spots = 0.0;
  bool has_spots = false;
};

Measured measured_by(const BeamProblem& problem) {
  Measured measured;
  for (const PreparedShot& shot : problem.shots) {
    if (!shot.used) continue;
    measured.rows += shot.num_rows();
    if (shot.plane && !shot.sigma_range_m) measured.of_ranges += 1.0;
    if (shot.spot_px && !shot.owns_spot_sigma) measured.of_spots += 2.0;
    measured.has_spots = measured.has_spots || shot.spot_px.has_value();
  }
  if (measured.of_ranges == 0.0) measured.of_ranges = measured.of_spots;  // spots alone hold the readings' errors, too
  return measured;
}

/// How many of the corners' residuals their σ was estimated from; 0: it was given.
double rows_of_corners(const BeamProblem& problem) {
  double rows = 0.0;
  for (const PreparedShot& shot : problem.shots)
    if (shot.board && !problem.sigma_corner_px) rows += 2.0 * static_cast<double>(shot.board->corners.size()) - 6.0;
  return rows;
}

/// Where the readings lie: centre and half of their span.
std::pair<double, double> span_of_readings(const BeamProblem& problem) {
  double least = 0.0, most = 0.0;
  for (const PreparedShot& shot : problem.shots) {
    if (!shot.used) continue;
    least = most > 0.0 ? std::min(least, shot.range_m) : shot.range_m;
    most = std::max(most, shot.range_m);
  }
  return {0.5 * (least + most), 0.5 * (most - least)};
}

template <typename ShareOf>
std::optional<ShotCause> tested(const std::string& name, const std::string& unit, Index num, double num_estimated,
                                const ReducedSystem& system, const SolvedPart& part, const VectorXd& g,
                                const ShareOf& share_of, ErrorScore ReducedShot::*score = &ReducedShot::errors) {
  VectorXd s = VectorXd::Zero(num);
  MatrixXd I = MatrixXd::Zero(num, num), across = MatrixXd::Zero(num, static_cast<Index>(part.places.size()));
  for (const ReducedShot& shot : system.shots) {
    const ErrorScore& of_shot = shot.*score;
    if (of_shot.by_common.cols() == 0) continue;
    const Share share = share_of(shot.index);
    s += share.transpose() * of_shot.s;
    I += share.transpose() * of_shot.I * share;
    across += share.transpose() * of_shot.by_common(Eigen::all, part.places);
  }
  const VectorXd alone = I.diagonal();
  s -= across * part.inverse * g;
  I -= across * part.inverse * across.transpose();
  // What the beam takes up but for a thousandth is not determined.
  if (!(I.diagonal().array() > 1e-3 * alone.array()).all() || !s.allFinite()) return std::nullopt;
  const VectorXd size = -Ldlt(I).solve(s);
  const double chi2 = -size.dot(s);
  ShotCause cause{name, size.norm(), unit, score_sigmas(chi2, static_cast<double>(num), num_estimated)};
  const VectorXd step = -part.inverse * across.transpose() * size;
  const Index num_beam =
      std::count_if(part.places.begin(), part.places.end(), [](Index place) { return place < num_beam_params; });
  cause.moves.head(num_beam) = step.head(num_beam);
  return cause;
}

}  // namespace

std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                                    const LensPrior& prior, const RangefinderReport& report) {
  constexpr double enough = 7.0;  // shots
  std::vector<ShotCause> causes;
  if (static_cast<double>(system.shots.size()) < enough) return causes;
  const Measured measured = measured_by(problem);
  const double left = 1.0 - problem.num_free() / std::max(1.0, measured.rows);
  const double of_ranges = report.range_sigma_is_estimated ? left * measured.of_ranges : 0.0;
  const double of_spots = report.spot_sigma_is_estimated ? left * measured.of_spots : 0.0;
  const VectorXd g = gradient_of(system, prior, report.camera)(part.places);
  const auto add = [&](const auto& cause) {
    if (cause) causes.push_back(*cause);
  };
  const double last = std::max(1.0, static_cast<double>(report.shots.size()) - 1.0);
  const auto over_rows = [&](std::size_t index) {
    return static_cast<double>(problem.shots[index].index) / last - 0.5;
  };
  const auto [middle_m, half_m] = span_of_readings(problem);
  add(tested("drift", "m", 1, of_ranges, system, part, g,
             [&](std::size_t index) { return Share(over_rows(index) * Eigen::Vector3d::UnitX()); }));
  if (half_m > 0.0)
    add(tested("bend", "m", 1, of_ranges, system, part, g, [&, at = middle_m, half = half_m](std::size_t index) {
      return Share(std::pow((problem.shots[index].range_m - at) / half, 2) * Eigen::Vector3d::UnitX());
    }));
  if (std::ranges::any_of(system.shots, &ReducedShot::has_corners))
    add(tested(
        "bent", "m", 3, rows_of_corners(problem), system, part, g,
        [](std::size_t) { return Share(Eigen::Matrix3d::Identity()); }, &ReducedShot::bend));
  if (measured.has_spots)
    add(tested("wander", "px", 2, of_spots, system, part, g, [&](std::size_t index) {
      return Share(over_rows(index) * Eigen::Matrix3d::Identity().rightCols<2>());
    }));
  return causes;
}

}  // namespace alidade
