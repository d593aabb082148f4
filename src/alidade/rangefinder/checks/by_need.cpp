#include <algorithm>
#include <cmath>

#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/solve/fixed_distortion.h"

namespace alidade {
namespace {

bool is_of_another_unit(const Verdict& verdict) {
  return std::any_of(verdict.checks.begin(), verdict.checks.end(),
                     [](const Check& check) { return check.name == "scale" && check.state == State::refused; });
}

/// One job's shots, and what is done with them.
struct Shots {
  std::span<const Shot> shots;
  std::span<const Eigen::Vector3d> points_in_board;
  const Progress& progress;

  [[nodiscard]] SolvedRangefinder solved_with(const Camera& camera, const RangefinderConfig& config) const {
    SolvedRangefinder solved{
        calibrate_rangefinder(shots, points_in_board, camera, config, progress), {}, config, camera};
    solved.verdict = rangefinder_verdict(solved.report, shots, config);
    return solved;
  }
  [[nodiscard]] bool have_boards() const {
    return std::any_of(shots.begin(), shots.end(), [](const Shot& shot) { return shot.has_plane(); });
  }
};

/// Distortion that the file gives without σ.
std::vector<int> opened_by_need(const Camera& file) {
  std::vector<int> opened = fixed_distortion(file, {});
  std::erase_if(opened, [&](int k) { return k < file.cov.rows() && file.cov(k, k) > 0.0; });
  return opened;
}

/// `file`: as given.
void name_freed(const Camera& file, const Shots& shots, SolvedRangefinder& solved) {
  const Eigen::VectorXd was = params(file.lens), is = params(solved.report.camera.lens);
  const std::vector<std::string> names = param_names(file.lens);
  solved.report.freed_distortion.clear();
  for (const int k : opened_by_need(file))
    solved.report.freed_distortion.push_back(
        {names[static_cast<std::size_t>(k)], was[k], is[k], std::sqrt(solved.report.camera.cov(k, k))});
  solved.verdict = rangefinder_verdict(solved.report, shots.shots, solved.config);
}

/// Twice: the corners of each board are weighed by how the lens that the solve starts with fits them. None where the
/// shots do not determine it.
std::optional<SolvedRangefinder> with_free_distortion(const Shots& shots, const Camera& camera,
                                                      const RangefinderConfig& config) {
  const Camera file = with_distortion(camera);
  const std::vector<int> opened = opened_by_need(file);
  Camera open = with_open_distortion(camera);
  if (opened.empty() || config.refine != Refine::all || open.cov.rows() != params(open.lens).size())
    return std::nullopt;
  std::optional<SolvedRangefinder> solved;
  for (int pass = 0; pass < 2; ++pass) {
    solved = shots.solved_with(open, config);
    if (solved->verdict.exit_code != ExitCode::ok) return std::nullopt;
    Eigen::VectorXd values = params(open.lens);
    values(opened) = params(solved->report.camera.lens)(opened);
    open.lens = with_params(open.lens, values);
  }
  name_freed(file, shots, *solved);
  return solved;
}

void name_overruled(const std::vector<OverruledSigma>& overruled, const Shots& shots, SolvedRangefinder& solved) {
  if (overruled.empty()) return;
  solved.report.overruled_sigmas = overruled;
  solved.verdict = rangefinder_verdict(solved.report, shots.shots, solved.config);
}

/// How many of the residuals say what the σ of a reading, and that of a spot's coordinate, is.
std::pair<double, double> spare_rows(const RangefinderReport& report) {
  double ranges = 0.0, spots = 0.0;
  for (const ShotFit& fit : report.shots) {
    if (!fit.used) continue;
    ranges += std::isfinite(fit.residual_range_m) ? 1.0 : 0.0;
    spots += fit.residual_px.allFinite() ? 2.0 : 0.0;
  }
  const double left = std::max(0.0, 1.0 - num_beam_params / std::max(1.0, ranges + spots));
  return {left * ranges, left * spots};
}

/// Is a σ larger than the one told by more than chance makes of so many residuals? √(2 χ²) is normal, R. A. Fisher.
bool is_larger(double found, double told, double rows) {
  constexpr double sure = 5.0;
  return std::sqrt(2.0 * rows) * found / told - std::sqrt(std::max(0.0, 2.0 * rows - 1.0)) > sure;
}

/// σ of a reading as it was told, with its growth, in the mean square over the shots used.
double told_sigma_m(const RangefinderReport& report, const Shots& shots, const RangeNoise& told) {
  double sum_m2 = 0.0, num = 0.0;
  for (std::size_t i = 0; i < report.shots.size(); ++i) {
    const ShotFit& fit = report.shots[i];
    if (!fit.used) continue;
    const double cosine = fit.plane ? std::abs(fit.plane->normal_in_cam.dot(report.beam.direction_in_cam)) : 1.0;
    const double tangent = std::sqrt(std::max(0.0, 1.0 - cosine * cosine)) / cosine;
    sum_m2 += std::pow(told.sigma_at(shots.shots[i].range_m, tangent), 2);
    num += 1.0;
  }
  return num > 0.0 ? std::sqrt(sum_m2 / num) : told.sigma_m;
}

/// With the σ that were told too small estimated, where that alone explains the shots. None: they were told well, or
/// something else is wrong too. `least_ratio`: by how much, where nothing else asks for it.
std::optional<SolvedRangefinder> with_found_sigmas(const Shots& shots, const Camera& camera,
                                                   const RangefinderConfig& config, double least_ratio) {
  RangefinderConfig open = config;
  open.sigma_range_m = open.sigma_range_per_m = open.sigma_incidence_m = open.sigma_spot_px = std::nullopt;
  SolvedRangefinder solved = shots.solved_with(camera, open);
  if (solved.verdict.exit_code != ExitCode::ok) return std::nullopt;
  const auto [of_ranges, of_spots] = spare_rows(solved.report);
  std::vector<OverruledSigma> overruled;
  open = config;
  const double found_m = solved.report.beam.noise.sigma_m;
  const auto told = config.range_noise();
  const double told_m = told ? told_sigma_m(solved.report, shots, *told) : found_m;
  if (found_m > least_ratio * told_m && is_larger(found_m, told_m, of_ranges)) {
    overruled.push_back({"sigma_range_m", told_m, found_m});
    open.sigma_range_m = open.sigma_range_per_m = open.sigma_incidence_m = std::nullopt;
  }
  if (const double found = solved.report.sigma_spot_px; config.sigma_spot_px &&
                                                        found > least_ratio * *config.sigma_spot_px &&
                                                        is_larger(found, *config.sigma_spot_px, of_spots)) {
    overruled.push_back({"sigma_px", *config.sigma_spot_px, found});
    open.sigma_spot_px = std::nullopt;
  }
  if (overruled.empty()) return std::nullopt;
  solved = shots.solved_with(camera, open);
  const auto names_a_cause = [](const Check& check) {
    return check.state != State::good && check.figure == "residuals";
  };
  if (solved.verdict.exit_code != ExitCode::ok || std::ranges::any_of(solved.verdict.checks, names_a_cause))
    return std::nullopt;
  name_overruled(overruled, shots, solved);
  return solved;
}

void refuse(const std::string& cause, SolvedRangefinder& solved) {
  if (solved.verdict.exit_code == ExitCode::ok) {
    solved.verdict.state = State::refused;
    solved.verdict.exit_code = ExitCode::undetermined;
  }
  solved.verdict.sentence = cause;
  solved.verdict.to_add =
      "give each row the range of its own spot and board, in metres; spots as u, v from the top left";
}

}  // namespace

SolvedRangefinder solve_rangefinder(std::span<const Shot> given, std::span<const Eigen::Vector3d> points_in_board,
                                    const Camera& camera, const RangefinderConfig& told, const Progress& progress) {
  const Shots shots{given, points_in_board, progress};
  RangefinderConfig config = told;
  SolvedRangefinder best = shots.solved_with(camera, config);
  if (config.sigma_range_m || config.sigma_spot_px)
    if (auto found = with_found_sigmas(shots, camera, config, best.verdict.state == State::good ? 3.0 : 1.0)) {
      best = std::move(*found);
      config = best.config;
    }
  const std::vector<OverruledSigma> overruled = best.report.overruled_sigmas;
  const bool is_solved = best.verdict.exit_code == ExitCode::ok, has_boards = shots.have_boards();
  if (has_boards && (!is_solved || wants_distortion(best.report, camera, config)))
    if (auto free = with_free_distortion(shots, camera, config)) {
      best = std::move(*free);
      name_overruled(overruled, shots, best);
    }
  // Spots alone have no left and right; where there are boards they have.
  const bool stands = best.verdict.exit_code == ExitCode::ok && config.method != RangefinderMethod::spot;
  if (const std::string cause = has_boards ? cause_of_misfit(given, points_in_board, best.camera, config, stands) : "";
      !cause.empty()) {
    refuse(cause, best);
    return best;
  }
  if (!wants_scale(best.report, config)) return best;
  RangefinderConfig with_scale = config;
  with_scale.estimate_scale = with_scale.scale_by_need = true;
  SolvedRangefinder free = shots.solved_with(best.camera, with_scale);
  if (!best.report.freed_distortion.empty()) name_freed(with_distortion(camera), shots, free);
  name_overruled(overruled, shots, free);
  // Readings in another unit have a scale, but that is no answer.
  const bool is_given = free.verdict.exit_code == ExitCode::ok || is_of_another_unit(free.verdict);
  return is_given ? free : best;
}

}  // namespace alidade
