#include "alidade/rig/rig.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "alidade/geometry/degree.h"
#include "alidade/rig/checks/rejected_view.h"
#include "alidade/rig/rig_causes.h"
#include "alidade/rig/rig_clusters.h"
#include "alidade/rig/rig_frame.h"
#include "alidade/rig/rig_given.h"
#include "alidade/rig/rig_start.h"
#include "alidade/rig/rig_work.h"

namespace alidade {
namespace {

using Status = RigReport::Status;

/// χ² of a view over its count; infinite where a corner is not seen.
std::vector<double> mean_chi2(const Work& work, const RigState& state) {
  std::vector<double> mean(work.given.size(), std::numeric_limits<double>::infinity());
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    if (!work.usable[v]) continue;
    if (const auto at = view_residuals(work.problem, state, v))
      mean[v] = at->r.squaredNorm() / static_cast<double>(at->r.size());
  }
  return mean;
}

double typical(const Work& work, const std::vector<double>& mean) {
  std::vector<double> used;
  for (std::size_t v = 0; v < mean.size(); ++v)
    if (work.usable[v]) used.push_back(mean[v]);
  return median_of(used);
}

/// Geman & McClure's weights, at a scale that half of the views set.
std::vector<double> soft_weights(const Work& work, const RigState& state) {
  const std::vector<double> mean = mean_chi2(work, state);
  const double scale = 9.0 * std::max(1.0, typical(work, mean));
  std::vector<double> weights;
  for (const double one : mean) weights.push_back(std::isfinite(one) ? std::pow(1.0 / (1.0 + one / scale), 2) : 0.0);
  if (!work.config.reject_outliers)
    for (std::size_t v = 0; v < weights.size(); ++v) weights[v] = std::isfinite(mean[v]) ? 1.0 : 0.0;
  return weights;
}

/// Readings of a view moved to where its board looks best: what a view that was rejected must be judged by.
void correct_reading(const Work& work, RigState& state, std::size_t v) {
  for (int i = 0; i < 3; ++i) {
    const auto at = view_residuals(work.problem, state, v);
    if (!at) return;
    const Eigen::Matrix2d H = at->J_correction.transpose() * at->J_correction;
    state.corrections_rad[v] -= H.inverse() * (at->J_correction.transpose() * at->r);
  }
}

/// Beyond it a view disagrees with the rig, of which a typical one has this χ² over its count.
double max_mean_chi2(const Work& work, double typical_mean, std::size_t v) {
  const auto rows = static_cast<double>(2 * work.given[v].seen.corners.size() + 2);
  return std::max(1.0, typical_mean) * std::max(4.0, 1.0 + 8.0 * std::sqrt(2.0 / rows));
}

std::vector<double> hard_weights(const Work& work, RigState& state, const std::vector<double>& before) {
  for (std::size_t v = 0; v < before.size(); ++v)
    if (work.usable[v] && before[v] < 0.5) correct_reading(work, state, v);
  const std::vector<double> mean = mean_chi2(work, state);
  const double typical_mean = typical(work, mean);
  std::vector<double> weights;
  for (std::size_t v = 0; v < mean.size(); ++v) {
    const bool is_near = mean[v] <= max_mean_chi2(work, typical_mean, v);
    const bool keep = std::isfinite(mean[v]) && (is_near || !work.config.reject_outliers);
    weights.push_back(keep ? 1.0 : 0.0);
  }
  return weights;
}

/// Soft weights until the views have settled, then those that disagree rejected.
std::optional<SolvedRig> solve_robustly(Work& work, const RigState& start, std::vector<double>& weights) {
  constexpr int rounds = 6;
  const Effort& effort = work.effort;
  int unsettled = 0;
  std::optional<SolvedRig> solved;
  RigState state = start;
  for (int round = 0; round < rounds; ++round) {
    report_progress(work.progress, "solve", static_cast<std::size_t>(round), rounds + 2);
    weights = soft_weights(work, state);
    solved = solve_rig(work.problem, state, weights, effort.iterations);
    if (!solved) return std::nullopt;
    work.report.iterations += solved->iterations;
    state = solved->state;
    if (!solved->converged && ++unsettled >= effort.unsettled_rounds) return std::nullopt;
    if (solved->converged && solved->iterations <= 2) break;
  }
  for (int round = 0; round < 3; ++round) {
    const std::vector<double> next = hard_weights(work, state, weights);
    const bool is_settled = round > 0 && next == weights;
    weights = next;
    if (is_settled) break;
    solved = solve_rig(work.problem, state, weights, effort.iterations);
    if (!solved) return std::nullopt;
    work.report.iterations += solved->iterations;
    state = solved->state;
    if (!solved->converged && ++unsettled >= effort.unsettled_rounds) return std::nullopt;
  }
  return solved;
}

double sum_of_corrections2(const Work& work, const SolvedRig& solved, const std::vector<double>& weights) {
  double sum = 0.0;
  for (std::size_t v = 0; v < work.given.size(); ++v)
    if (weights[v] > 0.0) sum += solved.state.corrections_rad[v].squaredNorm();
  return sum;
}

/// Solves, and with it what the encoders' noise is (Helmert's variance component). None: no convergence.
std::optional<SolvedRig> solve_with_noise(Work& work, const RigState& start, std::vector<double>& weights) {
  constexpr double usual_rad = 0.05 * degree, min_rad = 1e-3 * degree;
  constexpr double enough =
      8.0;  // from as many corrections a σ is known to a quarter; from fewer it is easily far too small
  work.report.sigma_encoder_is_estimated = !work.config.sigma_encoder_rad;
  work.problem.sigma_encoder_rad = work.config.sigma_encoder_rad.value_or(usual_rad);
  auto solved = solve_robustly(work, start, weights);
  for (int round = 0; round < 8 && solved && solved->converged && work.report.sigma_encoder_is_estimated; ++round) {
    const auto cov = rig_covariance(work.problem, *solved).cov;
    if (!cov) break;
    const double num = 2.0 * static_cast<double>(std::ranges::count(weights, 1.0));
    const double freedom = num - num_fixed_corrections(work.problem, *solved, *cov, weights);
    work.num_given = freedom >= enough ? freedom : 0.0;
    const double before = work.problem.sigma_encoder_rad;
    double sigma_rad = std::max(min_rad, std::sqrt(sum_of_corrections2(work, *solved, weights) / freedom));
    if (sigma_rad > work.effort.max_sigma_rad) return std::nullopt;
    if (!(freedom >= enough)) {
      work.report.sigma_encoder_is_estimated = false;
      sigma_rad = freedom > 1.0 ? std::max(sigma_rad, usual_rad) : usual_rad;
    }
    work.problem.sigma_encoder_rad = sigma_rad;
    solved = solve_robustly(work, solved->state, weights);
    if (std::abs(work.problem.sigma_encoder_rad / before - 1.0) < 0.02) break;
  }
  work.report.sigma_encoder_rad = work.problem.sigma_encoder_rad;
  return solved;
}

void describe_views(Work& work, const SolvedRig& solved, const std::vector<double>& weights) {
  double squares = 0.0, num = 0.0;
  const double typical_mean = typical(work, mean_chi2(work, solved.state));
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    HeadViewFit& fit = work.report.views[v];
    fit.used = weights[v] > 0.0;
    if (!fit.used && fit.reason.empty()) {
      const Rejection why = rejection_of(work, solved.state, v, max_mean_chi2(work, typical_mean, v));
      fit.reason = why.reason;
      fit.misreading = why.misreading;
    }
    (fit.used ? work.report.views_used : work.report.views_dropped) += 1;
    if (fit.used) ++work.report.covers[work.problem.views[v].head].num_used;
    const auto at = view_residuals(work.problem, solved.state, v);
    if (!at) continue;
    fit.chi2 = at->r.squaredNorm();
    fit.reading_correction_rad = solved.state.corrections_rad[v];
    double own = 0.0;
    for (Eigen::Index i = 0; i + 2 < at->r.size(); i += 2) {
      fit.residual_px.emplace_back(at->r.segment<2>(i) * work.problem.sigma_px);
      own += fit.residual_px.back().squaredNorm();
    }
    const auto count = static_cast<double>(fit.residual_px.size());
    fit.rms_px = std::sqrt(own / count);
    if (!fit.used) continue;
    squares += own;
    num += count;
    work.report.chi2 += fit.chi2;
  }
  work.report.rms_px = num > 0.0 ? std::sqrt(squares / num) : 0.0;
  int num_boards = 0;
  for (const auto& board : solved.system.boards) num_boards += board.V.isZero(0.0) ? 0 : 1;
  work.report.dof = solved.system.num_residuals - work.problem.num_free() - 6 * num_boards;
}

bool has_enough(const Work& work) {
  if (work.heads.empty()) return false;
  return std::ranges::all_of(work.report.covers, [](const HeadCover& cover) { return cover.num_views >= 3; });
}

bool turns_about_both_axes(const Work& work) {
  return std::ranges::all_of(work.report.covers, [](const HeadCover& cover) {
    return (cover.highest_rad - cover.lowest_rad).minCoeff() >= min_span_rad;
  });
}

void take_pulls(Work& work, const std::vector<double>& weights) {
  std::size_t next = 0;
  for (std::size_t v = 0; v < work.given.size(); ++v)
    if (weights[v] > 0.0 && next < work.report.clusters.z2.size())
      work.report.views[v].cluster_z2 = work.report.clusters.z2[next++];
}

/// ∂ parameters of all lenses / ∂ wide parameters: of lenses that are estimated.
Eigen::MatrixXd lenses_by_wide(const RigProblem& wide, const RigState& state, Eigen::Index num_lenses) {
  Eigen::MatrixXd M = Eigen::MatrixXd::Zero(num_lenses, wide.num_free());
  Eigen::Index first = 0;
  for (std::size_t h = 0; h < state.heads.size(); ++h) {
    const Eigen::VectorXd lens = params(state.heads[h].camera.lens);
    for (std::size_t k = 0; k < wide.free[h].size(); ++k) {
      const Eigen::Index col = wide.first_free(h) + static_cast<Eigen::Index>(k);
      if (wide.free[h][k] == focal_param) M.block<2, 1>(first, col) = lens.head<2>();
      if (wide.free[h][k] == centre_x_param) M(first + 2, col) = 1.0;
      if (wide.free[h][k] == centre_y_param) M(first + 3, col) = 1.0;
    }
    first += lens.size();
  }
  return M;
}

/// The covariance of heads and lenses together, where a lens has one or is estimated. `cov`: of the wide parameters,
/// with all that is given.
void take_lenses(Rig& rig, const RigGiven& given, const RigState& state, const Eigen::MatrixXd& J,
                 const Eigen::MatrixXd& cov) {
  const Eigen::MatrixXd M = lenses_by_wide(given.wide, state, given.cov_lenses.rows());
  if (given.cov_lenses.isZero(0.0) && M.isZero(0.0)) return;
  const Eigen::Index heads = rig.cov.rows(), lenses = given.cov_lenses.rows();
  rig.cov_with_lenses.resize(heads + lenses, heads + lenses);
  const Eigen::MatrixXd across_wide = cov * M.transpose() + given.cov_with_lenses;
  const Eigen::MatrixXd by_given = M * given.cov_with_lenses;
  const Eigen::MatrixXd of_lenses = M * cov * M.transpose() + by_given + by_given.transpose() + given.cov_lenses;
  const Eigen::MatrixXd across = J * across_wide;
  rig.cov_with_lenses << rig.cov, across, across.transpose(), of_lenses;
  Eigen::Index first = 0;
  for (RigHead& rig_head : rig.heads) {
    const Eigen::Index num = params(rig_head.camera.lens).size();
    const Eigen::MatrixXd own = of_lenses.block(first, first, num, num);
    if (rig_head.camera.cov.size() > 0 || !M.middleRows(first, num).isZero(0.0)) rig_head.camera.cov = own;
    first += num;
  }
}

/// Backlash with its σ; who reads rig.yaml does not know from which side an axis came: half of it is noise to them.
void take_backlash(Work& work, const RigState& state, const RigProblem& wide, const Eigen::MatrixXd& cov) {
  RigReport& report = work.report;
  report.backlash_rad.assign(state.heads.size(), Eigen::Vector2d::Zero());
  report.sigma_backlash_rad = report.backlash_rad;
  for (std::size_t h = 0; h < state.heads.size(); ++h) {
    for (std::size_t k = 0; k < wide.free[h].size(); ++k) {
      const int axis = wide.free[h][k] - pan_backlash_param;
      if (axis < 0 || h >= state.backlash_rad.size()) continue;
      const Eigen::Index at = wide.first_free(h) + static_cast<Eigen::Index>(k);
      report.backlash_rad[h][axis] = state.backlash_rad[h][axis];
      report.sigma_backlash_rad[h][axis] = std::sqrt(cov(at, at));
    }
    double& sigma_rad = report.rig.heads[h].head.encoder.sigma_rad;
    sigma_rad = std::hypot(sigma_rad, 0.5 * report.backlash_rad[h].cwiseAbs().maxCoeff());
  }
}

/// What each thing given does to the parameter that it moves most, in that one's stated σ.
void take_assumed(RigReport& report, const RigGiven& given, const Eigen::MatrixXd& J) {
  report.assumed = given.assumed;
  for (std::size_t i = 0; i < report.assumed.size(); ++i) {
    Assumption& what = report.assumed[i];
    const Eigen::VectorXd moved = J * given.moved[i];
    for (Eigen::Index k = 0; k < moved.size(); ++k) {
      const double variance = report.rig.cov(k, k);
      const auto head = static_cast<std::size_t>(k / num_head_params);
      const std::string name = "head" + std::to_string(report.rig.heads[head].head.id) + "." +
                               head_param_names[static_cast<std::size_t>(k % num_head_params)];
      if (!(variance > 0.0) || name == what.name || !(moved[k] * moved[k] > what.moves * what.moves * variance))
        continue;
      what.moves = std::abs(moved[k]) / std::sqrt(variance);
      what.moved = name;
      what.moved_by = moved[k];
    }
  }
}

void finish(Work& work, const SolvedRig& solved, const std::vector<double>& weights) {
  describe_views(work, solved, weights);
  const RigCovariance covariance = rig_covariance(work.problem, solved);
  if (!covariance.cov) {
    work.report.status = Status::degenerate;
    work.report.unknown = covariance.unknown;
    return;
  }
  RigState state = solved.state;
  for (RigHead& rig_head : state.heads) rig_head.head.encoder.sigma_rad = work.problem.sigma_encoder_rad;
  work.report.clusters =
      cluster_covariance(*covariance.cov, 1.0, view_cluster_steps(work.problem, solved, *covariance.cov, weights));
  take_pulls(work, weights);
  const RigGiven given = rig_given(work.problem, solved, *covariance.cov, weights, work.config);
  RigCauses causes = rig_causes(work.problem, solved, *covariance.cov, weights, given.assumed, given.cov_lenses,
                                work.num_given, work.report.clusters.inflation.array().square().mean());
  work.report.causes = std::move(causes.all);
  const Eigen::MatrixXd cov_wide =
      widened(work.problem, given.wide, work.report.clusters.cov + causes.moves * causes.moves.transpose());
  const WorldAtCamera world = world_at_camera(given.wide, state, cov_wide + given.cov);
  work.report.rig = world.rig;
  take_lenses(work.report.rig, given, state, world.J, cov_wide + given.cov);
  take_backlash(work, state, given.wide, cov_wide + given.cov);
  work.report.cov_model = world.J * widened(work.problem, given.wide, *covariance.cov) * world.J.transpose();
  take_assumed(work.report, given, world.J);
  work.report.deviance =
      solved.system.cost + 4.0 * static_cast<double>(work.report.views_used) * std::log(work.report.sigma_encoder_rad);
  for (std::size_t b = 0; b < work.boards.size(); ++b) {
    const Rigid3& old_from_board = state.world_from_board[b];
    work.report.boards.push_back({work.boards[b], world.world_from_old * old_from_board});
  }
  add_relative_sigma(work.report);
  work.report.status = solved.converged ? Status::converged : Status::no_convergence;
}

void calibrate(Work& work) {
  if (!has_enough(work)) return;
  if (const auto head = mirrored_head(work)) {
    work.report.status = Status::mirrored;
    work.report.mirrored_head = *head;
    return;
  }
  if (!start_mountings(work)) {
    work.report.status = Status::degrees;
    return;
  }
  if (!turns_about_both_axes(work)) {
    work.report.status = Status::degenerate;
    return;
  }
  choose_free(work);
  const PlacedRig placed = place_rig(work.problem, work.heads, work.boards.size(), work.usable, work.poses);
  if (std::ranges::count(placed.has_head, false) > 0) {
    work.report.status = Status::not_linked;
    return;
  }
  for (std::size_t v = 0; v < work.given.size(); ++v)
    if (!placed.has_board[work.problem.views[v].board]) work.usable[v] = false;
  std::vector<double> weights;
  const auto solved = solve_with_noise(work, placed.state, weights);
  work.report.status = Status::no_convergence;
  if (solved) finish(work, *solved, weights);
}

}  // namespace

RigReport calibrated_with(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                          const std::map<int, Camera>& cameras, const RigConfig& config, const FreedParams& freed,
                          const Progress& progress, const Effort& effort, double sigma_free_scale) {
  Work work = prepared_work(views, points_in_board, cameras, config, freed, progress);
  work.effort = effort;
  work.problem.sigma_scale = sigma_free_scale;
  calibrate(work);
  return std::move(work.report);
}

}  // namespace alidade
