#include "alidade/rangefinder/rangefinder.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/beam_bound.h"
#include "alidade/rangefinder/beam_search.h"
#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/refine_all.h"

namespace alidade {
namespace {

using Status = RangefinderReport::Status;

int num_rows_used(const BeamProblem& problem) {
  int rows = 0;
  for (const PreparedShot& shot : problem.shots) rows += shot.used ? shot.num_rows() : 0;
  return rows;
}

/// Rows enough, and as many as the method's start needs.
bool is_enough(const BeamProblem& problem, const RangefinderConfig& config) {
  int spots = 0, planes = 0;
  for (const PreparedShot& shot : problem.shots) {
    spots += shot.used && shot.spot_px ? 1 : 0;
    planes += shot.used && shot.plane ? 1 : 0;
  }
  if (spots >= 3 && !config.estimate_scale) return true;
  if (planes >= problem.num_free()) return true;
  return spots > 0 && planes > 0 && 2 * spots + planes >= 6 && spots + planes >= 4;
}

int dof_of(const BeamFit& fit, const BeamProblem& problem) {
  return std::max(1, fit.best.normals.num_rows - problem.num_free());
}

/// Where σ is not known: do the residuals of all say that some are wrong, by how much less those of the others are?
/// Three times as large they must be, more where few are left, as any few can be found to agree.
bool tells_outliers(const BeamFit& all, const BeamProblem& all_shots, const BeamFit& others,
                    const BeamProblem& other_shots) {
  const auto num_used = [](const BeamProblem& problem) {
    return std::count_if(problem.shots.begin(), problem.shots.end(), [](const auto& shot) { return shot.used; });
  };
  if (10 * num_used(other_shots) < 6 * num_used(all_shots)) return false;
  const int dof = dof_of(others, other_shots);
  const double limit = 3.0 * (1.0 + 5.0 / dof);
  return !(all.best.normals.cost / dof_of(all, all_shots) < limit * limit * others.best.normals.cost / dof);
}

/// Beam, outliers and noise, lens and poses held: what is marked in the problem stays for what follows.
std::optional<BeamFit> search_beam(Preparation& ready, const Camera& camera, const RangefinderConfig& config,
                                   const Progress& progress) {
  BeamProblem& problem = ready.problem;
  const bool knows_sigma = ready.knows_range_sigma && ready.knows_spot_sigma;
  report_progress(progress, "beam", 0, 3);
  auto fit = best_beam(problem, camera);
  const auto num_used = static_cast<std::size_t>(
      std::count_if(problem.shots.begin(), problem.shots.end(), [](const auto& shot) { return shot.used; }));
  const bool can_tell = config.reject_outliers && num_used >= sample_size(problem) + 2;
  if (can_tell && (!knows_sigma || !fit || looks_wrong(problem, camera, fit->best))) {
    report_progress(progress, "outliers", 1, 3);
    BeamProblem without = problem;
    const auto agreed = find_outliers(without, camera,
                                      {config.outlier_sigmas, config.num_draws, config.seed, knows_sigma,
                                       std::pow(ready.least_sigma_range_m / guessed_sigma_m, 2)});
    auto better = agreed ? best_beam(without, camera, agreed) : std::nullopt;
    if (better && (knows_sigma || !fit || tells_outliers(*fit, problem, *better, without))) {
      problem = std::move(without);
      fit = std::move(better);
    }
  }
  constexpr int rounds = 12;  // of σ and beam in turn: linear, a factor of five each
  for (int round = 0; round < rounds && fit && !knows_sigma; ++round) {
    const double change =
        estimate_noise(problem, camera, fit->best.beam, !ready.knows_spot_sigma, !ready.knows_range_sigma);
    if (!ready.knows_range_sigma)
      problem.model.noise.sigma_m = std::max(problem.model.noise.sigma_m, ready.least_sigma_range_m);
    auto solved = solve_beam(problem, camera, fit->best.beam);
    if (solved) fit->best = std::move(*solved);
    if (change < 1e-3 || !solved) break;
  }
  return fit && !knows_sigma ? best_beam(problem, camera, fit->best.beam) : fit;
}

/// Covariance of a beam whose lens and poses were held: the lens' own is carried through (G = ∂beam/∂lens).
void carry_lens(const BeamProblem& problem, const BeamSolution& solution, const Camera& camera, Beam& beam) {
  const int p = problem.num_free();
  const Ldlt H(solution.normals.H.topLeftCorner(p, p));
  beam.cov.setZero();
  beam.cov.topLeftCorner(p, p) = H.inverse();
  const Eigen::Index num_lens = camera.cov.rows();
  const auto normals = beam_normals(problem, camera, solution.beam);
  if (num_lens == 0 || !normals || normals->H_lens.cols() != num_lens || !camera.cov.allFinite()) return;
  const Eigen::MatrixXd G = -H.solve_each(normals->H_lens.topRows(p));
  beam.cov.topLeftCorner(p, p) += G * camera.cov * G.transpose();
  beam.cov_with_lens.setZero(num_beam_params, num_lens);
  beam.cov_with_lens.topRows(p) = G * camera.cov;
}

CommonState start_state(const BeamProblem& problem, const Camera& camera, const Beam& beam) {
  CommonState state{beam, camera, {}};
  for (const PreparedShot& shot : problem.shots)
    state.cam_from_board.push_back(shot.board ? std::optional(shot.pose->cam_from_board) : std::nullopt);
  return state;
}

void put_fit(const PreparedShot& shot, const RangefinderReport& report, const ShotModel& model, ShotFit& fit) {
  fit.used = shot.used && shot.num_rows() > 0;
  fit.plane = shot.plane;
  fit.pose = shot.pose;
  fit.point_in_cam = point_at(report.beam, shot.range_m);
  const auto residual = shot_residual(shot, report.beam, report.camera, model);
  if (!residual) {
    if (!fit.used && fit.reason.empty()) fit.reason = "the beam does not meet its board";
    return;
  }
  const auto cov = full_covariance(shot, *residual);
  if (shot.plane) {
    fit.residual_range_m = residual->r[0];
    fit.sigma_range_m = std::sqrt(cov(0, 0));
  }
  if (shot.spot_px) {
    fit.residual_px = residual->r.tail<2>();
    fit.cov_px = cov.bottomRightCorner<2, 2>();
  }
  if (fit.used || !fit.reason.empty()) return;
  char text[96];
  if (shot.plane && std::abs(fit.residual_range_m) > 3.0 * fit.sigma_range_m)
    std::snprintf(text, sizeof text, "outlier: its range is %.3g m %s than its board says",
                  std::abs(fit.residual_range_m), fit.residual_range_m < 0.0 ? "longer" : "shorter");
  else
    std::snprintf(text, sizeof text, "outlier: its spot is %.3g px from where its range puts it",
                  fit.residual_px.norm());
  fit.reason = text;
}

void put_fits(const BeamProblem& problem, RangefinderReport& report) {
  double sum_px = 0.0, sum_m = 0.0, num_px = 0.0, num_m = 0.0;
  for (const PreparedShot& shot : problem.shots) {
    ShotFit& fit = report.shots[shot.index];
    put_fit(shot, report, problem.model, fit);
    if (!fit.used) continue;
    ++report.shots_used;
    if (std::isfinite(fit.residual_range_m)) sum_m += std::pow(fit.residual_range_m, 2), num_m += 1.0;
    if (fit.residual_px.allFinite()) sum_px += fit.residual_px.squaredNorm(), num_px += 1.0;
    if (shot.spot_px && !shot.owns_spot_sigma) report.sigma_spot_px = shot.sigma_spot_px;
  }
  report.shots_dropped = static_cast<int>(report.shots.size()) - report.shots_used;
  report.rms_px = num_px > 0.0 ? std::sqrt(sum_px / num_px) : 0.0;
  report.rms_range_m = num_m > 0.0 ? std::sqrt(sum_m / num_m) : 0.0;
}

/// Poses, planes and lens as the refinement left them.
void take_over(const RefinedBeam& refined, BeamProblem& problem, RangefinderReport& report) {
  report.beam = refined.state.beam;
  report.camera = refined.state.camera;
  report.cost = refined.system.cost;
  report.dof = refined.system.num_residuals - refined.num_parameters;
  report.iterations += refined.iterations;
  for (std::size_t i = 0; i < problem.shots.size(); ++i) {
    PreparedShot& shot = problem.shots[i];
    if (!refined.poses[i]) continue;
    shot.pose = refined.poses[i];
    if (shot.plane) shot.plane = plane_of(shot.pose->cam_from_board);
  }
}

/// Do the readings ask for a scale? What the residuals of all shots shrink by with one parameter more, lens and poses
/// held, over what is left: where σ was told by residuals, they hold the missing scale too.
double scale_in_sigmas(const BeamProblem& problem, const Camera& camera, const Beam& beam, bool sigma_is_told) {
  const auto planes = std::count_if(problem.shots.begin(), problem.shots.end(),
                                    [](const PreparedShot& shot) { return shot.used && shot.plane; });
  if (problem.estimate_scale || planes < 8) return 0.0;
  BeamProblem with_scale = problem;
  with_scale.estimate_scale = true;
  const auto without = solve_beam(problem, camera, beam), with = solve_beam(with_scale, camera, beam);
  if (!without || !with || !with->converged) return 0.0;
  const double left = with->normals.cost / std::max(1, with->normals.num_rows - num_beam_params);
  const double gain = std::max(0.0, without->normals.cost - with->normals.cost);
  const double z = std::sqrt(gain / std::max(left, sigma_is_told ? 1e-30 : 1.0));
  return with->beam.scale < 1.0 ? -z : z;
}

void solve_report(Preparation& ready, const BeamFit& fit, const Camera& camera, const RangefinderConfig& config,
                  RangefinderReport& report) {
  BeamProblem& problem = ready.problem;
  const LensPrior prior = lens_prior(camera, config.refine_distortion);
  const CommonState start = start_state(problem, camera, fit.best.beam);
  const bool refines = config.refine == Refine::all;
  const auto refined = refine_all(problem, prior, start, refines ? config.max_iterations : 0);
  report.beam = fit.best.beam;
  report.iterations = fit.best.iterations;
  report.alternatives = fit.alternatives;
  report.status = !refined                                                   ? Status::degenerate
                  : !fit.alternatives.empty()                                ? Status::ambiguous
                  : !refined->converged || (!refines && !fit.best.converged) ? Status::no_convergence
                                                                             : Status::converged;
  if (refines && refined) {
    take_over(*refined, problem, report);
  } else {
    report.cost = fit.best.normals.cost;
    report.dof = fit.best.normals.num_rows - problem.num_free();
    carry_lens(problem, fit.best, camera, report.beam);
  }
  report.beam.noise = problem.model.noise;
  report.scale_in_sigmas = scale_in_sigmas(problem, report.camera, report.beam, report.range_sigma_is_told);
  report.bound = judge_beam(problem, report.beam, report.camera);
  report.bound.cov =
      refined ? refined->state.beam.cov : BeamMatrix(BeamMatrix::Constant(std::numeric_limits<double>::infinity()));
}

}  // namespace

RangefinderReport calibrate_rangefinder(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                                        const Camera& camera, const RangefinderConfig& config,
                                        const Progress& progress) {
  Preparation ready = prepare_shots(shots, points_in_board, camera, config);
  BeamProblem& problem = ready.problem;
  RangefinderReport report;
  report.camera = camera;
  report.sigma_corner_px = ready.sigma_corner_px;
  report.sigma_spot_px = config.sigma_spot_px.value_or(guessed_sigma_px);
  report.spot_sigma_is_told = !ready.knows_spot_sigma;
  report.range_sigma_is_told = !ready.knows_range_sigma;
  report.shots.resize(shots.size());
  for (std::size_t i = 0; i < shots.size(); ++i) report.shots[i].reason = ready.reasons[i];
  report.shots_dropped = static_cast<int>(shots.size());
  const bool has_planes =
      std::any_of(problem.shots.begin(), problem.shots.end(), [](const auto& shot) { return shot.used && shot.plane; });
  if (config.estimate_scale && !has_planes) {
    report.status = Status::scale_unknown;
    return report;
  }
  if (!is_enough(problem, config)) return report;
  const auto fit = search_beam(ready, camera, config, progress);
  if (!fit) {
    report.status = num_rows_used(problem) >= problem.num_free() ? Status::degenerate : Status::too_few;
    report.bound = judge_beam(problem, report.beam, camera);
    report.bound.condition = std::numeric_limits<double>::infinity();
    put_fits(problem, report);
    return report;
  }
  report_progress(progress, "refinement", 2, 3);
  solve_report(ready, *fit, camera, config, report);
  put_fits(problem, report);
  return report;
}

}  // namespace alidade
