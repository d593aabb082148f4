#include "alidade/rangefinder/rangefinder.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>

#include "alidade/geometry/decompositions.h"
#include "alidade/rangefinder/prepare.h"
#include "alidade/rangefinder/solve/beam_bound.h"
#include "alidade/rangefinder/solve/beam_search.h"
#include "alidade/rangefinder/solve/error_causes.h"
#include "alidade/rangefinder/solve/fixed_distortion.h"
#include "alidade/rangefinder/solve/fixed_quantities.h"
#include "alidade/rangefinder/solve/refine_all.h"

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

/// ln of the number of ways to choose k of n.
double log_choices(double n, double k) {
  return std::lgamma(n + 1.0) - std::lgamma(k + 1.0) - std::lgamma(n - k + 1.0);
}

/// Where σ is not known: do the residuals of all say that some are wrong, by how much less those of the others are?
/// Three times as large they must be, more where few are left, and so much that by chance no choice of as many shots
/// would do so once in a thousand logs: likelihood ratio of normal residuals, times the number of choices.
bool shows_outliers(const BeamFit& all, const BeamProblem& all_shots, const BeamFit& others,
                    const BeamProblem& other_shots) {
  const auto num_used = [](const BeamProblem& problem) {
    return static_cast<double>(
        std::count_if(problem.shots.begin(), problem.shots.end(), [](const auto& shot) { return shot.used; }));
  };
  const double num_all = num_used(all_shots), num_others = num_used(other_shots);
  constexpr double chance = 1e-3;
  constexpr int min_spare = 2;
  const int spare = others.best.normals.num_rows - other_shots.num_free();
  if (num_others < 0.6 * num_all || spare < min_spare) return false;
  const double ratio = all.best.normals.cost / others.best.normals.cost;
  if (0.5 * spare * std::log(ratio) < log_choices(num_all, num_all - num_others) - std::log(chance)) return false;
  const double limit = 3.0 * (1.0 + 5.0 / spare);
  return !(ratio * spare / dof_of(all, all_shots) < limit * limit);
}

/// Beam, outliers and noise, lens and poses fixed: what is marked in the problem stays for what follows.
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
                                       std::pow(ready.min_sigma_range_m / guessed_sigma_m, 2)});
    auto better = agreed ? best_beam(without, camera, agreed) : std::nullopt;
    if (better && (knows_sigma || !fit || shows_outliers(*fit, problem, *better, without))) {
      problem = std::move(without);
      fit = std::move(better);
    }
  }
  constexpr int rounds = 12;  // of σ and beam in turn: linear, a factor of five each
  for (int round = 0; round < rounds && fit && !knows_sigma; ++round) {
    const double change =
        estimate_noise(problem, camera, fit->best.beam, !ready.knows_spot_sigma, !ready.knows_range_sigma);
    if (!ready.knows_range_sigma)
      problem.model.noise.sigma_m = std::max(problem.model.noise.sigma_m, ready.min_sigma_range_m);
    auto solved = solve_beam(problem, camera, fit->best.beam);
    if (solved) fit->best = std::move(*solved);
    if (change < 1e-3 || !solved) break;
  }
  return fit && !knows_sigma ? best_beam(problem, camera, fit->best.beam) : fit;
}

/// ∂beam/∂lens of a beam whose lens and poses were fixed; empty where the lens' covariance is not known.
Eigen::MatrixXd J_beam_lens(const BeamProblem& problem, const Camera& camera, const Beam& beam) {
  const Eigen::Index num_lens = camera.cov.rows();
  const auto normals = beam_normals(problem, camera, beam);
  if (num_lens == 0 || !normals || normals->H_lens.cols() != num_lens || !camera.cov.allFinite()) return {};
  const int p = problem.num_free();
  return -Ldlt(normals->H.topLeftCorner(p, p)).solve_each(normals->H_lens.topRows(p));
}

/// The covariance of a lens that was fixed is carried through.
void carry_lens(const BeamProblem& problem, const Camera& camera, RangefinderReport& report) {
  const Eigen::MatrixXd G = J_beam_lens(problem, camera, report.beam);
  if (G.size() == 0) return;
  const int p = problem.num_free();
  const Eigen::MatrixXd carried = G * camera.cov * G.transpose();
  report.beam.cov.topLeftCorner(p, p) += carried;
  report.cov_model.topLeftCorner(p, p) += carried;
  report.beam.cov_with_lens.setZero(num_beam_params, camera.cov.rows());
  report.beam.cov_with_lens.topRows(p) = G * camera.cov;
}

/// How much of what the clusters say beyond the model is believed. With few shots their scatter is noise for the most
/// part, and raises σ by a tenth where all is as the model says: from 0 where the design effect is 1 to all of it at
/// 2.5 of its own σ, √(2/(shots · parameters)).
double weight_of(const ClusterCovariance& clusters, int num_parameters) {
  const double num_scores = static_cast<double>(clusters.z2.size()) * num_parameters;
  return std::clamp((clusters.design_effect - 1.0) * std::sqrt(0.5 * num_scores) / 2.5, 0.0, 1.0);
}

/// Covariances that count that the measurements of a shot share errors: shots are the clusters. `inverse`: of the
/// information of the beam's free parameters and of the lens'.
void put_clusters(const BeamProblem& problem, const ReducedSystem& system, const SolvedPart& part,
                  const LensPrior& prior, RangefinderReport& report) {
  report.clusters = cluster_covariance(part.inverse, 1.0, shot_clusters(system, part.places, part.inverse));
  const int p = problem.num_free();
  Eigen::MatrixXd& cov = report.clusters.cov;
  cov = part.inverse + weight_of(report.clusters, p) * (cov - part.inverse);
  report.clusters.inflation = (cov.diagonal().array() / part.inverse.diagonal().array()).sqrt();
  report.cov_model.setZero();
  report.cov_model.topLeftCorner(p, p) = part.inverse.topLeftCorner(p, p);
  report.beam.cov.setZero();
  report.beam.cov.topLeftCorner(p, p) = cov.topLeftCorner(p, p);
  const auto k = static_cast<Eigen::Index>(prior.free.size());
  if (k > 0) {
    report.lens_cov_model = report.camera.cov;
    report.camera.cov(prior.free, prior.free) = cov.bottomRightCorner(k, k);
    report.beam.cov_with_lens(Eigen::seqN(0, p), prior.free) = cov.topRightCorner(p, k);
  }
  for (std::size_t i = 0; i < report.clusters.z2.size(); ++i)
    report.shots[problem.shots[system.shots[i].index].index].cluster_z2 = report.clusters.z2[i];
}

/// What was given with a σ is carried into the beam's covariance.
void carry_given(RangefinderReport& report) {
  for (const FixedQuantity& thing : report.fixed) {
    if (!thing.sigma || (thing.name != "square_m" && thing.name != "scale")) continue;  // the lens' is in it already
    const BeamVector moved = *thing.sigma * thing.moves;
    report.beam.cov += moved * moved.transpose();
    report.cov_model += moved * moved.transpose();
  }
}

/// A lens that was free, and that the shots pulled farther from its file than its covariance lets expect: the file's
/// error is so much larger, and the beam follows it. It is believed from none where what the shots ask for is 2.5 of
/// its σ away to all of it at 4, if the shots by themselves know the lens at least half as well as its file.
void carry_surprise(RangefinderReport& report) {
  constexpr double doubtful = 2.5, sure = 4.0, worst = 2.2;
  for (const FixedQuantity& thing : report.fixed) {
    if (!thing.name.starts_with("camera") || !thing.sigma || !(thing.asked_sigma < worst * *thing.sigma)) continue;
    const double z = std::abs(thing.asked) / thing.asked_sigma;
    if (z < doubtful) continue;
    const double weight = std::min(1.0, (z - doubtful) / (sure - doubtful));
    const double more2 = weight * (z * z - 1.0) * std::pow(thing.asked_sigma, 2);
    report.beam.cov += more2 * thing.moves * thing.moves.transpose();
  }
}

/// What the shots half ask for, and what they say of a length that was given: the answer may be off by as much.
void carry_asked(RangefinderReport& report) {
  constexpr double hardly = 2.0;
  constexpr double proved = 3.5, ordinary_m = 0.003;  // chance shows few shots sizes that no board has
  for (const ShotCause& cause : report.causes) {
    if (!(cause.sigmas > hardly)) continue;
    const bool may_be_chance = cause.sigmas < proved && (cause.name == "incidence" || cause.name == "sheet");
    const double share = may_be_chance ? std::min(1.0, ordinary_m / cause.size) : 1.0;
    report.beam.cov += share * share * cause.moves * cause.moves.transpose();
  }
  for (const FixedQuantity& thing : report.fixed) {
    if (thing.name != "scale" || !thing.sigma) continue;
    const double beyond = std::hypot(*thing.sigma, thing.asked_sigma), z = std::abs(thing.asked) / beyond;
    if (z > hardly) report.beam.cov += thing.asked * thing.asked * thing.moves * thing.moves.transpose();
  }
}

/// A scale that is there by need and half proved may be none: then what is off is the lens or the board.
void carry_scale(RangefinderReport& report) {
  constexpr double hardly = 2.0, proved = 4.0;
  double& variance = report.beam.cov(beam_scale_param, beam_scale_param);
  if (!report.scale_by_need || !(variance > 0.0)) return;
  const double away = report.beam.scale - 1.0;
  report.scale_in_sigmas = away / std::sqrt(variance);
  const double z = std::abs(report.scale_in_sigmas);
  if (z > hardly && z < proved) variance += away * away;
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

/// σ of the answer, what pulls at it, and what it rests on. `state`: where the solve ended.
void put_uncertainty(const BeamProblem& problem, const LensPrior& prior, const CommonState& state, const Camera& camera,
                     const RangefinderConfig& config, RangefinderReport& report) {
  CommonState wide = state;
  wide.camera = with_distortion(state.camera);
  const ReducedSystem system = reduced_system(problem, prior, wide);
  SolvedPart part{system.places(problem.num_free(), prior.free), {}};
  const Eigen::MatrixXd information = system.H(part.places, part.places);
  constexpr double rounding = 1e13;  // an inverse of more is made of it
  if (!(scaled_condition(information) < rounding)) return;
  part.inverse = inverse_of_scaled(information);
  if (!part.inverse.allFinite()) return;
  put_clusters(problem, system, part, prior, report);
  report.fixed = fixed_quantities(system, part, prior, camera, problem.points_in_board, report, config);
  report.causes = error_causes(problem, system, part, prior, report);
  report.sheet = open_sheet(problem, system, part, report, config);
  for (FixedQuantity& sigma : fixed_sigmas(problem, report)) report.fixed.push_back(std::move(sigma));
  if (config.refine == Refine::beam) carry_lens(problem, camera, report);
  carry_given(report);
  if (config.refine == Refine::all) carry_surprise(report);
  carry_asked(report);
  carry_scale(report);
  report.beam.cov += report.sheet.counted();
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
  }
  report.beam.noise = problem.model.noise;
  if (refined) {
    report.beam.cov = report.cov_model = refined->state.beam.cov;
    put_uncertainty(problem, refines ? prior : LensPrior{}, refines ? refined->state : start, camera, config, report);
  } else {
    const int p = problem.num_free();
    report.beam.cov.setZero();
    report.beam.cov.topLeftCorner(p, p) = Ldlt(fit.best.normals.H.topLeftCorner(p, p)).inverse();
    carry_lens(problem, camera, report);
  }
  if (!report.scale_by_need)
    report.scale_in_sigmas =
        scale_in_sigmas(problem, report.camera, report.beam, report.range_sigma_is_estimated, ready.min_sigma_range_m);
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
  RangefinderReport report = report_before_solving(ready, shots, points_in_board, camera, config);
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
