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

/// What is tested, and what of it is known before.
struct TestedCause {
  std::string name, unit;
  Index num = 1;               ///< Of its parameters.
  double num_estimated = 0.0;  ///< Residuals from which the σ was estimated; 0: it was given.
  double told = 0.0;           ///< σ of its size; 0: none is told.
};

/// A step of the solve as one of the beam.
BeamVector beam_part(const SolvedPart& part, const VectorXd& step) {
  const Index num_beam =
      std::count_if(part.places.begin(), part.places.end(), [](Index place) { return place < num_beam_params; });
  BeamVector beam = BeamVector::Zero();
  beam.head(num_beam) = step.head(num_beam);
  return beam;
}

template <typename ShareOf>
std::optional<ShotCause> tested(const TestedCause& candidate, const ReducedSystem& system, const SolvedPart& part,
                                const VectorXd& g, const ShareOf& share_of,
                                ErrorScore ReducedShot::*score = &ReducedShot::errors) {
  const Index num = candidate.num;
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
  ShotCause cause{.name = candidate.name, .unit = candidate.unit};
  if (candidate.told > 0.0 && s.allFinite()) {
    const double left = 1.0 / std::sqrt(std::pow(candidate.told, -2) + std::max(0.0, I(0, 0)));
    cause.left_open = beam_part(part, -part.inverse * across.row(0).transpose() * left);
  }
  // What the beam takes up but for a thousandth is not determined.
  if (!(I.diagonal().array() > 1e-3 * alone.array()).all() || !s.allFinite())
    return candidate.told > 0.0 ? std::optional(cause) : std::nullopt;
  const VectorXd size = -Ldlt(I).solve(s);
  const double chi2 = -size.dot(s);
  cause.size = size.norm();
  cause.sigmas = score_sigmas(chi2, static_cast<double>(num), candidate.num_estimated);
  cause.moves = beam_part(part, -part.inverse * across.transpose() * size);
  return cause;
}

/// Of each shot that was used, what of its three errors a cause is.
struct ShotShares {
  std::vector<double> over_rows, over_range, tangent;
  std::vector<Eigen::Vector3d> sheet;  ///< For a metre between the surface that the beam meets and the corners.
};

ShotShares shares_of(const BeamProblem& problem, const RangefinderReport& report) {
  const std::size_t num = problem.shots.size();
  ShotShares shares{std::vector(num, 0.0), std::vector(num, 0.0), std::vector(num, 0.0),
                    std::vector<Eigen::Vector3d>(num, Eigen::Vector3d::Zero())};
  const double last = std::max(1.0, static_cast<double>(report.shots.size()) - 1.0);
  const auto [middle_m, half_m] = span_of_readings(problem);
  for (std::size_t i = 0; i < num; ++i) {
    const PreparedShot& shot = problem.shots[i];
    shares.over_rows[i] = static_cast<double>(shot.index) / last - 0.5;
    if (half_m > 0.0) shares.over_range[i] = std::pow((shot.range_m - middle_m) / half_m, 2);
    const auto residual = shot.used && shot.plane ? shot_residual(shot, report.beam, report.camera, problem.model)
                                                  : std::optional<ShotResidual>{};
    if (!residual) continue;
    const double cosine = std::abs(shot.plane->normal_in_cam.dot(report.beam.direction_in_cam));
    shares.tangent[i] = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) / cosine;
    // A surface that lies before the plane by a metre: one whose d is so much larger.
    const auto by_d = residual->J_plane.col(3);
    shares.sheet[i][0] = -by_d[0];
    if (shot.spot_px) shares.sheet[i].tail<2>() = -by_d.tail<2>();
  }
  return shares;
}

/// How many residuals say of each σ what it is; 0: it was given.
struct Estimated {
  double of_ranges = 0.0, of_spots = 0.0;
};

Estimated estimated_by(const BeamProblem& problem, const Measured& measured, const RangefinderReport& report) {
  const double left = 1.0 - problem.num_free() / std::max(1.0, measured.rows);
  return {report.range_sigma_is_estimated ? left * measured.of_ranges : 0.0,
          report.spot_sigma_is_estimated ? left * measured.of_spots : 0.0};
}

}  // namespace

std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                                    const LensPrior& prior, const RangefinderReport& report,
                                    const RangefinderConfig& config) {
  constexpr std::size_t enough = 7;  // shots
  const Measured measured = measured_by(problem);
  const auto [of_ranges, of_spots] = estimated_by(problem, measured, report);
  const VectorXd g = gradient_of(system, prior, report.camera)(part.places);
  const ShotShares shares = shares_of(problem, report);
  const bool has_corners = std::ranges::any_of(system.shots, &ReducedShot::has_corners);
  std::vector<ShotCause> causes;
  const auto add = [&](const TestedCause& candidate, const auto& share_of, auto score) {
    if (auto cause = tested(candidate, system, part, g, share_of, score)) causes.push_back(std::move(*cause));
  };
  const auto of_errors = &ReducedShot::errors;
  const auto of_reading = [](double share) { return Share(share * Eigen::Vector3d::UnitX()); };
  add(
      {"drift", "m", 1, of_ranges}, [&](std::size_t i) { return of_reading(shares.over_rows[i]); }, of_errors);
  add(
      {"bend", "m", 1, of_ranges}, [&](std::size_t i) { return of_reading(shares.over_range[i]); }, of_errors);
  add(
      {"incidence", "m", 1, of_ranges}, [&](std::size_t i) { return of_reading(shares.tangent[i]); }, of_errors);
  if (has_corners)
    add(
        {"sheet", "m", 1, of_ranges, config.sigma_flat_m.value_or(0.0)},
        [&](std::size_t i) { return Share(shares.sheet[i]); }, of_errors);
  if (has_corners)
    add(
        {"bent", "m", 3, rows_of_corners(problem)}, [](std::size_t) { return Share(Eigen::Matrix3d::Identity()); },
        &ReducedShot::bend);
  if (measured.has_spots)
    add(
        {"wander", "px", 2, of_spots},
        [&](std::size_t i) { return Share(shares.over_rows[i] * Eigen::Matrix3d::Identity().rightCols<2>()); },
        of_errors);
  if (system.shots.size() >= enough) return causes;
  std::erase_if(causes, [](const ShotCause& cause) { return cause.left_open.isZero(0.0); });
  for (ShotCause& cause : causes) cause = {.name = cause.name, .unit = cause.unit, .left_open = cause.left_open};
  return causes;
}

}  // namespace alidade
