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
};

/// What the errors of all shots say of a cause's size with the beam solved again.
struct CauseScore {
  VectorXd s, alone;    ///< ∂cost/2, and the information were the beam known.
  MatrixXd I, by_beam;  ///< Information; the beam's step for a unit of the cause.
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
CauseScore score_of(Index num, const ReducedSystem& system, const SolvedPart& part, const VectorXd& g,
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
  CauseScore found{s - across * part.inverse * g, I.diagonal(), {}, -part.inverse * across.transpose()};
  found.I = I + across * found.by_beam;
  return found;
}

std::optional<ShotCause> tested(const TestedCause& candidate, const CauseScore& score, const SolvedPart& part) {
  // What the beam takes up but for a thousandth is not determined.
  if (!(score.I.diagonal().array() > 1e-3 * score.alone.array()).all() || !score.s.allFinite()) return std::nullopt;
  const VectorXd size = -Ldlt(score.I).solve(score.s);
  const double chi2 = -size.dot(score.s);
  return ShotCause{candidate.name, size.norm(), candidate.unit,
                   score_sigmas(chi2, static_cast<double>(candidate.num), candidate.num_estimated),
                   beam_part(part, score.by_beam * size)};
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
    if (!shot.used || !shot.plane) continue;
    const double cosine = std::abs(shot.plane->normal_in_cam.dot(report.beam.direction_in_cam));
    shares.tangent[i] = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) / cosine;
    shares.sheet[i] = sheet_share(shot, report.beam, report.camera, problem.model);
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

Eigen::Vector3d sheet_share(const PreparedShot& shot, const Beam& beam, const Camera& camera, const ShotModel& model) {
  Eigen::Vector3d share = Eigen::Vector3d::Zero();
  const auto residual =
      shot.used && shot.plane ? shot_residual(shot, beam, camera, model) : std::optional<ShotResidual>{};
  if (!residual) return share;
  // A surface that lies before the plane by a metre: one whose d is so much larger.
  const auto by_d = residual->J_plane.col(3);
  share[0] = -by_d[0];
  if (shot.spot_px) share.tail<2>() = -by_d.tail<2>();
  return share;
}

CountedSheet open_sheet(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                        const RangefinderReport& report, const RangefinderConfig& config) {
  CountedSheet sheet{.sigma_m = config.sigma_flat_m.value_or(0.0)};
  if (!(sheet.sigma_m > 0.0) || !std::ranges::any_of(system.shots, &ReducedShot::has_corners)) return {};
  const ShotShares shares = shares_of(problem, report);
  const auto num = static_cast<Index>(part.places.size());
  const CauseScore score =
      score_of(1, system, part, VectorXd::Zero(num), [&](std::size_t i) { return Share(shares.sheet[i]); });
  sheet.left_m = left_of(sheet.sigma_m, score.I(0, 0));
  sheet.moves = beam_part(part, score.by_beam.col(0) * sheet.left_m);
  return sheet.moves.allFinite() && !sheet.moves.isZero(0.0) ? sheet : CountedSheet{};
}

double left_of(double sigma_m, double information) {
  return 1.0 / std::sqrt(std::pow(sigma_m, -2) + std::max(0.0, information));
}

std::vector<ShotCause> error_causes(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                                    const LensPrior& prior, const RangefinderReport& report) {
  constexpr std::size_t enough = 7;  // shots
  if (system.shots.size() < enough) return {};
  const Measured measured = measured_by(problem);
  const auto [of_ranges, of_spots] = estimated_by(problem, measured, report);
  const VectorXd g = gradient_of(system, prior, report.camera)(part.places);
  const ShotShares shares = shares_of(problem, report);
  const bool has_corners = std::ranges::any_of(system.shots, &ReducedShot::has_corners);
  std::vector<ShotCause> causes;
  const auto add = [&](const TestedCause& candidate, const auto& share_of, auto score) {
    if (auto cause = tested(candidate, score_of(candidate.num, system, part, g, share_of, score), part))
      causes.push_back(std::move(*cause));
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
        {"sheet", "m", 1, of_ranges}, [&](std::size_t i) { return Share(shares.sheet[i]); }, of_errors);
  if (has_corners)
    add(
        {"bent", "m", 3, rows_of_corners(problem)}, [](std::size_t) { return Share(Eigen::Matrix3d::Identity()); },
        &ReducedShot::bend);
  if (measured.has_spots)
    add(
        {"wander", "px", 2, of_spots},
        [&](std::size_t i) { return Share(shares.over_rows[i] * Eigen::Matrix3d::Identity().rightCols<2>()); },
        of_errors);
  return causes;
}

}  // namespace alidade
