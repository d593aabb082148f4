#include "alidade/observe.h"

#include <algorithm>
#include <utility>

#include "alidade/observe/checks/frame_places.h"
#include "alidade/observe/checks/standing_rows.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/observe/solve/solve_once.h"

namespace alidade {
namespace {

/// The pixels of the reference and their residuals.
std::vector<ObserveResidual> reference_residuals(const RotationLog& log, const ObserveSolution& solution) {
  const Adjustment& reference = solution.reference;
  std::vector<ObserveResidual> residuals;
  if (!reference.has_value) return residuals;
  std::vector<int> log_point(reference.bundle.points.size(), -1);
  for (std::size_t i = 0; i < reference.bundle_point_of.size(); ++i) {
    if (reference.bundle_point_of[i] >= 0) {
      log_point[static_cast<std::size_t>(reference.bundle_point_of[i])] = static_cast<int>(i);
    }
  }
  const PixelScale& scale = solution.scale;
  for (std::size_t i = 0; i < reference.solution.residuals.size(); ++i) {
    const BundleObservation& seen = reference.bundle.observations[i];
    const double t_s = reference.bundle.frames[static_cast<std::size_t>(seen.frame)].t_s;
    const auto row = std::lower_bound(log.rows.begin(), log.rows.end(), t_s - 1e-9,
                                      [](const RotationRow& each, double time) { return each.t_s < time; });
    residuals.push_back({static_cast<int>(row - log.rows.begin()), log_point[static_cast<std::size_t>(seen.point)],
                         scale.scale * seen.px + scale.centre, scale.scale * reference.solution.residuals[i]});
  }
  return residuals;
}

std::vector<TestedCause> tested_causes_of(const std::vector<CauseScore>& scores) {
  std::vector<TestedCause> causes;
  for (const CauseScore& score : scores) {
    causes.push_back({.name = score.name, .z = score.z});
    for (const CauseMember& member : score.members) {
      causes.back().values.push_back({member.name, member.unit, member.value, member.sigma});
    }
  }
  return causes;
}

/// The report of a solution, with its verdict.
ObserveReport judged_observation(ObserveSolution solution, RotationLog log, const ObserveSetup& setup) {
  solution.verdict = observe_verdict(solution, log, setup);
  solution.counts.given = log.rows.size();
  solution.counts.used = solution.rows_used;
  solution.counts.dropped = log.rows.size() - solution.rows_used;
  solution.size_is_guessed = setup.width_px <= 0;
  if (solution.status == ObserveReport::Status::ok) {
    solution.camera = observed_camera(solution, setup.lens_is_given ? setup.camera : std::nullopt);
  } else {
    solution.quantities.clear();
    solution.covariance.resize(0, 0);
  }
  solution.residuals = reference_residuals(log, solution);
  solution.tested_causes = tested_causes_of(solution.causes);
  const StatedCovariance& stated = solution.stated;
  solution.shared_errors = {stated.blocks.design_effect, stated.correlation_s, stated.block_s, stated.track_effect,
                            solution.jitter.noise_rad()};
  if (setup.rotation != RotationKnowledge::known) {
    const AdjustConfig adjusted = adjust_config_of(log, setup, start_camera(setup, solution.scale), solution.scale);
    solution.sigma_angle_rad = adjusted.sigma_rotation_rad;
    solution.sigma_rate_rad_per_s = adjusted.sigma_rate_rad_per_s;
  }
  solution.log = std::move(log);
  return std::move(static_cast<ObserveReport&>(solution));
}

std::size_t num_zooms(const ObserveSolution& solution) {
  return static_cast<std::size_t>(std::ranges::count_if(solution.events, [](const ObserveNote& note) {
    return note.event == ObserveEvent::zoom || note.event == ObserveEvent::restart;
  }));
}

/// Number of parameters that explain the pixels, other than those of one camera.
std::size_t num_explained_by(const ObserveSolution& solution) {
  return static_cast<std::size_t>(CommonLayout(solution.estimated).size) + solution.estimated_errors.size() +
         num_zooms(solution) + (solution.mounting_step ? 3 : 0);
}

/// Solutions with images moved to other rows are better if they have less noise, or as much with fewer causes: zooms, a
/// delay or a bump explain part of the effect of a gap. Repeated images are removed in any case.
bool is_better(const ObserveSolution& solution, const ObserveSolution& as_given, const FramePlaces& places) {
  constexpr double less = 0.8, as_much = 1.1;
  const auto is_answer = [](const ObserveSolution& each) { return each.status == ObserveSolution::Status::ok; };
  if (!is_answer(solution) || !is_answer(as_given)) return is_answer(solution);
  if (places.missing.empty() || solution.sigma_px < less * as_given.sigma_px) return true;
  constexpr std::size_t fewer = 2;  // for a head that stops and goes: a delay alone, or a gap before its first move
  return solution.sigma_px < as_much * as_given.sigma_px &&
         num_explained_by(solution) + fewer <= num_explained_by(as_given);
}

/// If frames were dropped or repeated, solves again with the images in the rows of their time.
void heed_places(const ObserveSetup& setup, const Progress& progress, RotationLog& log, ObserveSolution& solution) {
  if (std::ranges::count(setup.estimate_errors, "clock rate") > 0) return;  // rows stay: a slow clock looks like gaps
  const FramePlaces places = frame_places(log);
  if (places.are_as_given()) return;
  RotationLog moved = placed(log, places);
  ObserveSolution again = solve_intrinsics(moved, setup, progress);
  if (!is_better(again, solution, places)) return;
  again.side_checks.push_back(places_check(log, places));
  solution = std::move(again);
  log = std::move(moved);
}

/// If rows in which the camera stands still share their errors, each stop counts once.
void heed_stops(const ObserveSetup& setup, const Progress& progress, RotationLog& log, ObserveSolution& solution) {
  constexpr double mostly = 0.5, most_own = 0.7;
  constexpr std::size_t fewest = 3;
  const StandingRows standing = standing_rows(log);
  if (standing.stops.size() < fewest) return;
  const bool may_share = num_zooms(solution) > 0 || solution.status != ObserveSolution::Status::ok ||
                         standing.sigma_within_px < most_own * solution.sigma_px;
  if (!may_share) return;
  RotationLog once = with_each_stop_once(log, standing);
  ObserveSolution again = solve_intrinsics(once, setup, progress);
  if (again.status != ObserveSolution::Status::ok || shared_within_stops(again, log, standing) < mostly) return;
  again.side_checks.push_back(standing_check(again, standing));
  solution = std::move(again);
  log = std::move(once);
}

}  // namespace

ObserveReport observe(RotationLog log, const ObserveConfig& config, const Progress& progress) {
  const ObserveSetup setup = setup_of(config);
  check_log(log);
  if (log.source == RotationSource::none && setup.rotation != RotationKnowledge::free) {
    throw ConfigError("the log has no rotation: give one, or --rotation free");
  }
  if (setup.rotation == RotationKnowledge::free) log.source = RotationSource::none;
  check_rotation_words(setup, log);
  if (setup.lens_is_given) {
    for (RotationRow& row : log.rows) undistort(*setup.camera, Eigen::Vector2d::Constant(not_seen), row.px);
  }
  ObserveSolution solution = solve_intrinsics(log, setup, progress);
  if (setup.rotation == RotationKnowledge::known) {
    heed_places(setup, progress, log, solution);
    heed_stops(setup, progress, log, solution);
  }
  return judged_observation(std::move(solution), std::move(log), setup);
}

}  // namespace alidade
