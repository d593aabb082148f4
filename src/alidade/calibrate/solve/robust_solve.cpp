#include "alidade/calibrate/solve/robust_solve.h"

#include <algorithm>

#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/other_minima.h"

namespace alidade {
namespace {

using Residuals = std::vector<std::vector<Eigen::Vector2d>>;

Residuals all_residuals(const CalibrationWork& work, const BundleState& state) {
  Residuals residuals;
  residuals.reserve(work.arrays.size());
  for (std::size_t k = 0; k < work.arrays.size(); ++k) residuals.push_back(residuals_px(state, k, work.arrays[k]));
  return residuals;
}

void whiten(CalibrationWork& work, const Residuals& residuals, const NoiseEstimate& noise, double huber_sigmas) {
  for (std::size_t k = 0; k < work.views.size(); ++k) {
    set_whiteners(work.views[k], residuals[k], noise, noise.used[k], work.use_covariances, huber_sigmas,
                  work.arrays[k]);
  }
}

/// Views of which two corners in five fit nothing do not belong to this board and camera.
bool drop_misfits(const NoiseEstimate& noise, CalibrateReport& report, CalibrationWork& work, BundleState& state) {
  bool dropped = false;
  for (std::size_t k = work.views.size(); k-- > 0;) {
    const auto bad = std::count(noise.used[k].begin(), noise.used[k].end(), false);
    const auto all = static_cast<std::ptrdiff_t>(noise.used[k].size());
    if (5 * bad <= 2 * all) continue;
    drop_view(k, std::to_string(bad) + " of " + std::to_string(all) + " corners do not fit the other photos", report,
              work, state);
    dropped = true;
  }
  return dropped;
}

/// How near the optimum: a tenth of a σ does where the corners' weights are still to change.
enum class Nearness { rough, full };

BundleResult solve(CalibrationWork& work, BundleState start, const CalibrateConfig& config, Nearness nearness) {
  work.problem.views = work.arrays;
  const double tolerance = nearness == Nearness::rough ? 0.1 : BundleConfig{}.tolerance_sigmas;
  return solve_past_fold(work.problem, std::move(start), {config.max_iterations, tolerance, 0.0});
}

/// Alternates solve and noise estimate until no corner changes sides. The first solve weighs all corners alike.
BundleResult solve_once(const CalibrateConfig& config, CalibrateReport& report, CalibrationWork& work,
                        BundleState state, NoiseEstimate& noise) {
  const bool weights_matter =
      work.use_covariances || work.problem.prior_information.any() || work.problem.shape == BoardShape::free;
  constexpr int max_rounds = 8;
  constexpr double huber_sigmas = 2.5;
  BundleResult result = solve(work, std::move(state), config, weights_matter ? Nearness::rough : Nearness::full);
  report.iterations = result.iterations;
  std::vector<std::vector<bool>> used_before;
  double excess_before = -1.0;
  for (int round = 0; round < max_rounds; ++round) {
    const Residuals residuals = all_residuals(work, result.state);
    noise = estimate_noise(work.views, residuals, work.use_covariances, rejects_outliers(config, work.use_covariances),
                           config.outlier_sigmas, num_parameters(work));
    const bool clean = noise.num_dropped == 0;
    if (round == 0 && clean && !weights_matter) return result;
    const bool settled = noise.used == used_before && std::abs(noise.excess_px - excess_before) <= 0.01 * excess_before;
    if (settled) break;
    // Outliers bias the first solves: reduce their weight before identifying them.
    const bool soft = !clean && round < 3;
    if (!soft && drop_misfits(noise, report, work, result.state)) {
      used_before.clear();
      if (work.views.size() < 2) break;
      make_all_arrays(config, work);
      result = solve(work, std::move(result.state), config, Nearness::full);
      report.iterations += result.iterations;
      continue;
    }
    used_before = soft ? std::vector<std::vector<bool>>{} : noise.used;
    excess_before = noise.excess_px;
    whiten(work, residuals, noise, soft ? huber_sigmas : 0.0);
    result = solve(work, std::move(result.state), config, soft ? Nearness::rough : Nearness::full);
    report.iterations += result.iterations;
  }
  return result;
}

/// The result with its covariance. A poorly determined parameter makes the solve creep: then, too, there is one, to
/// name that parameter. Not where the corners do not fit: that is another fault.
BundleResult finished(BundleResult result, bool settled, const CalibrationWork& work) {
  double sum = 0.0, count = 0.0;
  for (std::size_t k = 0; k < work.arrays.size() && !settled; ++k) {
    for (const Eigen::Vector2d& r : residuals_px(result.state, k, work.arrays[k])) {
      sum += r.squaredNorm();
      count += 1.0;
    }
  }
  constexpr double fits_px = 2.0;
  const bool creeps = !settled && (!is_central(result.state.lens) || sum < fits_px * fits_px * count);
  if (creeps && result.equations) result.status = BundleResult::Status::converged;
  return with_covariance(std::move(result));
}

/// Looks for other minima where the views may have some, and settles in the least.
Minima find_minima(BundleResult found, bool settled, const CalibrateConfig& config, ImageSize size,
                   CalibrateReport& report, CalibrationWork& work, NoiseEstimate& noise) {
  std::vector<BundleState> starts =
      starts_elsewhere(work.problem, found, variance_of(work, found, noise), work.views, size.width_px);
  const BundleConfig solve_config{config.max_iterations, BundleConfig{}.tolerance_sigmas};
  std::vector<BundleResult> others = other_minima(work.problem, found, starts, solve_config);
  if (others.empty() || !(others.front().cost < found.cost)) return {std::move(found), settled, std::move(others)};
  CalibrationWork again = work;
  NoiseEstimate noise_again;
  BundleResult solved = solve_once(config, report, again, others.front().state, noise_again);
  if (solved.status != BundleResult::Status::converged) return {std::move(found), settled, std::move(others)};
  work = std::move(again);
  noise = std::move(noise_again);
  starts.push_back(std::move(found.state));
  BundleResult least = finished(std::move(solved), true, work);
  others = other_minima(work.problem, least, starts, solve_config);
  return {std::move(least), true, std::move(others)};
}

}  // namespace

void drop_view(std::size_t at, const std::string& reason, CalibrateReport& report, CalibrationWork& work,
               BundleState& state) {
  report.views[work.number[at]].reason = reason;
  const auto offset = static_cast<std::ptrdiff_t>(at);
  work.number.erase(work.number.begin() + offset);
  work.views.erase(work.views.begin() + offset);
  work.far.erase(work.far.begin() + offset);
  if (at < work.arrays.size()) work.arrays.erase(work.arrays.begin() + offset);
  if (at < state.cam_from_board.size()) state.cam_from_board.erase(state.cam_from_board.begin() + offset);
}

void make_all_arrays(const CalibrateConfig& config, CalibrationWork& work) {
  work.arrays.clear();
  for (std::size_t k = 0; k < work.views.size(); ++k) {
    work.arrays.push_back(make_arrays(work.views[k]));
    for (std::size_t i = 0; rejects_outliers(config, work.use_covariances) && i < work.far[k].size(); ++i) {
      if (work.far[k][i]) set_whitener(work.arrays[k], i, Eigen::Matrix2d::Identity(), 0.0);
    }
  }
}

int num_parameters(const CalibrationWork& work) {
  const int shape_gauge = work.problem.shape == BoardShape::free ? 7 : 0;
  return num_unknown_globals(work.problem) - shape_gauge + 6 * static_cast<int>(work.views.size());
}

double variance_of(const CalibrationWork& work, const BundleResult& result, const NoiseEstimate& noise) {
  double corners = 0.0;
  for (const auto& view : noise.used) corners += static_cast<double>(std::count(view.begin(), view.end(), true));
  return result.cost / std::max(1.0, 2.0 * corners - num_parameters(work));
}

Minima solve_robustly(const CalibrateConfig& config, ImageSize size, BundleState start, CalibrateReport& report,
                      CalibrationWork& work, NoiseEstimate& noise) {
  BundleResult solved = solve_once(config, report, work, std::move(start), noise);
  const bool settled = solved.status == BundleResult::Status::converged;
  return find_minima(finished(std::move(solved), settled, work), settled, config, size, report, work, noise);
}

}  // namespace alidade
