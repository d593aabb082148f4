#include "alidade/localize/path/whole_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>
#include <set>

#include "alidade/localize/checks/scale_readings.h"
#include "alidade/localize/checks/summary.h"
#include "alidade/localize/imu/imu_alignment.h"
#include "alidade/localize/path/loop_closure.h"
#include "alidade/localize/path/remaining_points.h"

namespace alidade {
namespace {

/// Marks which frames fit the smoothed path: frames that the filter had lost may be determined there by their
/// observations.
void judge_frames(const SmoothedPath& smoothed, std::size_t first_frame, std::span<const ObservationFrame> frames,
                  Localization& result) {
  std::vector<std::size_t> num_fit(result.path.size(), 0);
  result.num_unexplained = 0;
  for (const PlacedResidual& residual : smoothed.residuals) ++num_fit[first_frame + residual.frame];
  for (std::size_t k = first_frame; k < result.path.size(); ++k) {
    PathStep& step = result.path[k];
    const bool was_lost = step.event == FrameEvent::predicted || step.event == FrameEvent::waiting;
    if (was_lost && num_fit[k] >= min_observations) step.event = FrameEvent::tracked;
    std::size_t num_of_map = 0;
    for (const FeatureObservation& observation : frames[k].observations)
      num_of_map += std::ranges::binary_search(smoothed.ids, observation.id) ? 1 : 0;
    result.num_unexplained += 2 * num_fit[k] < num_of_map ? 1 : 0;
  }
}

/// Without a target, a second initial guess is tried if the errors are autocorrelated, as in real videos and in the
/// wrong one of two minima.
std::optional<SmoothedPath> best_path(const SmootherProblem& problem) {
  constexpr std::size_t max_frames = 600;  // over longer paths, equal depths are not a useful guess
  auto smoothed = smoothed_path(problem);
  if (problem.gauge != PathGauge::similarity || problem.world_from_cam.size() > max_frames) return smoothed;
  if (smoothed && !smoothed->structure.is_autocorrelated()) return smoothed;
  const auto flat = flat_start(problem);
  if (!flat) return smoothed;
  auto other = smoothed_path(*flat);
  const double gate = problem.filter.gate;
  const bool is_better = other && (!smoothed || cost_of(*other, gate) < cost_of(*smoothed, gate));
  return is_better ? std::move(other) : std::move(smoothed);
}

/// Smooths the path of `result`. Empty, without any change, if that does not converge, or if next to nothing fits the
/// path.
std::optional<SmoothedPath> smooth(const SmootherProblem& problem, std::span<const ObservationFrame> frames,
                                   Localization& result) {
  auto smoothed = best_path(problem);
  if (!smoothed || smoothed->residuals.size() < min_observations * smoothed->world_from_cam.size()) return std::nullopt;
  result.residuals = smoothed->structure;
  for (std::size_t k = 0; k < smoothed->cov.size(); ++k) {
    PathStep& step = result.path[problem.first_frame + k];
    step.world_from_cam = smoothed->world_from_cam[k];
    step.cov = smoothed->cov[k];
  }
  judge_frames(*smoothed, problem.first_frame, frames, result);
  result.num_untied = num_untied(smoothed->residuals, problem.first_frame, result.path);
  return smoothed;
}

/// Starts the problem at the solution of another one, multiplied by `scale`, with its point weights.
void begin_at(const SmoothedPath& smoothed, double scale, SmootherProblem& problem) {
  for (std::size_t k = 0; k < problem.world_from_cam.size(); ++k) {
    problem.world_from_cam[k] = smoothed.world_from_cam[k];
    problem.world_from_cam[k].translation *= scale;
  }
  if (smoothed.is_lens_freed) problem.freed_lens = smoothed.camera.lens;
  problem.usual_variance = smoothed.usual_variance;
  std::vector<SmootherPoint> points;
  for (SmootherPoint& point : problem.points) {
    const auto at = std::ranges::lower_bound(smoothed.ids, point.id);
    if (at == smoothed.ids.end() || *at != point.id) continue;
    const auto index = static_cast<std::size_t>(at - smoothed.ids.begin());
    point.point_in_world = scale * smoothed.points[index];
    point.error_factor = smoothed.error_factors[index];
    points.push_back(point);
  }
  problem.points = std::move(points);
}

/// Smooths with closed loops, if that converges and fits as well as without; else without.
std::optional<SmoothedPath> smooth_with_loops(const Recording& recording, SmootherProblem& problem,
                                              Localization& result) {
  const std::vector<ObservationFrame>& frames = recording.frames.frames();
  auto open = smooth(problem, frames, result);
  if (!open || recording.number_of.empty()) return open;
  SmootherProblem closed = problem;
  begin_at(*open, 1.0, closed);
  closed.weighs_points = false;
  const LoopClosure closure = close_loops(recording.number_of, max_points_at_once(frames.size()), closed);
  result.num_loops_rejected = closure.num_rejected;
  if (closure.num_joined == 0) return open;
  Localization again = result;
  auto smoothed = smooth(closed, frames, again);
  if (!smoothed || !fits_as_well(*smoothed, *open, closure.num_joined, problem.filter.gate)) {
    result.num_loops_rejected += closure.num_loops;
    return open;
  }
  again.num_loops = closure.num_loops;
  result = std::move(again);
  problem = std::move(closed);
  problem.weighs_points = true;
  return smoothed;
}

/// Whether too many frames have too few of the problem's points although enough is seen there: without a target, a
/// filter that knows few depths may leave half of a path to the motion model.
bool leaves_frames(const SmootherProblem& problem, std::span<const ObservationFrame> frames) {
  constexpr std::size_t many = 20;  // one frame in 20
  std::vector<std::size_t> num_of_map(problem.world_from_cam.size(), 0);
  for (const UsedObservation& each : problem.observations) ++num_of_map[each.frame];
  std::size_t num_left = 0;
  for (std::size_t k = 0; k < num_of_map.size(); ++k)
    num_left +=
        num_of_map[k] < min_observations && frames[problem.first_frame + k].observations.size() >= min_observations ? 1
                                                                                                                    : 0;
  return many * num_left > num_of_map.size();
}

bool drops_much(const SmoothedPath& smoothed, const SmootherProblem& problem) {
  constexpr std::size_t few = 20;
  return few * smoothed.num_dropped > problem.observations.size();
}

/// Whether a lens was estimated, and much of what the filter observed with the former one does not fit.
bool has_other_lens(const SmoothedPath& smoothed, const SmootherProblem& problem) {
  return smoothed.is_lens_freed && drops_much(smoothed, problem);
}

/// After a restart the filter knows few depths, often those of the target only, which a path with a wrong lens fits as
/// well. So solves again with everything observed; repeatedly, with what fits the new lens, if one is estimated, or the
/// better path. If that does not converge, all frames count as unexplained.
void solve_with_remaining(std::span<const ObservationFrame> frames, bool frees_lens, SmootherProblem& given,
                          SmoothedPath& smoothed, Localization& result) {
  constexpr int most = 3;
  for (int i = 0; i < most; ++i) {
    SmootherProblem problem = given;
    const std::size_t num_points = given.points.size();
    begin_at(smoothed, 1.0, problem);
    add_remaining(smoothed, frames.subspan(given.first_frame), problem);
    problem.frees_lens = frees_lens;
    Localization again = result;
    auto with_all = smooth(problem, frames, again);
    if (!with_all && i == 0) result.num_unexplained = result.path.size();
    if (!with_all) return;
    result = std::move(again);
    smoothed = std::move(*with_all);
    given = std::move(problem);
    if (!has_other_lens(smoothed, given) && !(drops_much(smoothed, given) && given.points.size() > num_points)) return;
  }
}

/// Matches of images have a σ floor, the error of patches of real scenes. If the residuals are far below it, as for
/// rendered images, sets σ to 2.5 times the residuals' and solves once more.
void solve_with_found_sigma(std::span<const ObservationFrame> frames, const LocalizeConfig& config,
                            SmootherProblem& given, SmoothedPath& smoothed, Localization& result) {
  constexpr double far_below = 0.1, generous = 2.5;  // squares over σ²
  if (!result.is_of_images || config.sigma_px || !(smoothed.chi2_per_dof < far_below)) return;
  const double least_px = config.features.sigma_floor_px;
  const double found_px = generous * std::sqrt(smoothed.chi2_per_dof) * least_px;
  SmootherProblem problem = given;
  begin_at(smoothed, 1.0, problem);
  problem.usual_variance *= least_px * least_px / (found_px * found_px);
  for (UsedObservation& each : problem.observations)
    each.sigma_px = std::sqrt(std::max(each.sigma_px * each.sigma_px - least_px * least_px, 0.0) + found_px * found_px);
  Localization again = result;
  auto by_found = smooth(problem, frames, again);
  if (!by_found) return;
  result = std::move(again);
  result.sigma_px = found_px;
  result.sigma_px_from = SigmaPxFrom::residuals;
  smoothed = std::move(*by_found);
  given = std::move(problem);
}

/// Sets a prior on each point's distance from the frame where it was first seen, at its current value, so weak that all
/// together determine the scale to `sigma_rel`, and nothing else.
void believe_distances(double sigma_rel, SmootherProblem& problem) {
  const double sigma_of_one = sigma_rel * std::sqrt(static_cast<double>(problem.points.size()));
  for (SmootherPoint& point : problem.points) {
    const Eigen::Vector3d away = point.point_in_world - problem.world_from_cam[point.first_frame].translation;
    point.range = RangePrior{away.norm(), sigma_of_one};
  }
}

/// Solves a path up to scale again, in metres, if other sensors determine its scale. Returns metres per former unit.
double solve_in_metres(const Recording& recording, const LocalizeConfig& config, SmootherProblem& given,
                       SmoothedPath& smoothed, Localization& result) {
  if (!config.target.points.empty()) return 1.0;
  std::vector<MapPoint> map;
  for (std::size_t i = 0; i < smoothed.ids.size(); ++i)
    map.push_back({smoothed.ids[i], smoothed.points[i], smoothed.point_covs[i], false, 0});
  read_scales(config, map, result);
  const auto read = scale_of(result);
  if (!read) return 1.0;
  SmootherProblem problem = given;
  begin_at(smoothed, read->scale, problem);
  believe_distances(read->sigma_rel, problem);
  if (problem.gauge == PathGauge::similarity) problem.gauge = PathGauge::motion;
  Localization again = result;
  auto in_metres = smooth(problem, recording.frames.frames(), again);
  if (!in_metres) return 1.0;
  result = std::move(again);
  smoothed = std::move(*in_metres);
  given = std::move(problem);
  result.is_scale_read = result.scale_known = true;
  return read->scale;
}

std::vector<TimedPose> poses_of(const SmootherProblem& problem, const SmoothedPath& smoothed) {
  std::vector<TimedPose> poses;
  for (std::size_t k = 0; k < problem.t_s.size(); ++k) poses.push_back({problem.t_s[k], smoothed.world_from_cam[k]});
  return poses;
}

/// The IMU as input of the smoother, initialised from its alignment. Clock and rotation stay free: the data that gave
/// their first estimate are in the equations again.
SmootherImu imu_to_solve(const Imu& given, ImuAlignment alignment, std::span<const double> t_s) {
  constexpr double found_rotation_rad = 0.3, found_position_m = 0.1, found_late_s = 0.02, any_clock_rate = 5e-5;
  constexpr double node_apart_s = 10.0, most_nodes = 9.0;
  SmootherImu imu{.readings = std::move(alignment.readings), .noise = given.noise, .start = {}};
  imu.gravity_m_s2 = given.gravity_m_s2;
  imu.sigma_gravity_m_s2 = given.sigma_gravity_m_s2;
  imu.sigma_rotation_rad = given.mounting ? given.mounting->sigma_rotation_rad : found_rotation_rad;
  imu.sigma_position_m = given.mounting ? given.mounting->sigma_position_m : found_position_m;
  imu.sigma_late_s = found_late_s;
  imu.sigma_clock_rate = std::hypot(any_clock_rate, 3.0 * alignment.estimate.sigma_clock_rate);
  const ImuEstimate& found = alignment.estimate;
  const double length_s = t_s.back() - t_s.front();
  const int num = static_cast<int>(std::clamp(std::ceil(length_s / node_apart_s), 1.0, most_nodes - 1.0)) + 1;
  for (int i = 0; i < num; ++i) {
    imu.start.node_t_s.push_back(t_s.front() + length_s * i / (num - 1));
    imu.start.rate_bias.push_back(found.rate_bias);
    imu.start.force_bias.push_back(found.force_bias);
  }
  imu.start.gravity_in_world = found.gravity_in_world;
  imu.start.imu_in_cam = found.cam_from_imu.translation;
  return imu;
}

/// Copies the estimate of an IMU to its own axes.
void fill_estimate(const SmoothedImu& found, ImuEstimate& estimate) {
  const ImuState& state = found.state;
  const Eigen::Matrix3d imu_from_cam = estimate.cam_from_imu.rotation.conjugate().toRotationMatrix();
  const auto in_imu = [&](int at) {
    const Eigen::Vector3d variances = found.sigma.segment<3>(at).cwiseAbs2();
    return Eigen::Vector3d((imu_from_cam.cwiseAbs2() * variances).cwiseSqrt());
  };
  const int last = state.gravity_at() - 6;
  estimate.rate_bias = imu_from_cam * state.rate_bias.back();
  estimate.force_bias = imu_from_cam * state.force_bias.back();
  estimate.sigma_rate_bias = in_imu(last);
  estimate.sigma_force_bias = in_imu(last + 3);
  estimate.cam_from_imu = {(state.turn * estimate.cam_from_imu.rotation).normalized(), state.imu_in_cam};
  estimate.sigma_rotation_rad = found.sigma.segment<3>(state.turn_at());
  estimate.sigma_position_m = found.sigma.segment<3>(state.place_at());
  estimate.gravity_in_world = state.gravity_in_world;
  estimate.sigma_gravity = found.sigma.segment<3>(state.gravity_at());
  estimate.late_s += state.late_s;
  estimate.sigma_late_s = found.sigma[state.late_at()];
  estimate.clock_rate += state.clock_rate;
  estimate.sigma_clock_rate = found.sigma[state.clock_rate_at()];
  estimate.rate_walk_factor = found.rate_walk_factor;
  estimate.force_walk_factor = found.force_walk_factor;
  estimate.rate_drift = imu_from_cam * (state.rate_bias.back() - state.rate_bias.front());
  estimate.force_drift = imu_from_cam * (state.force_bias.back() - state.force_bias.front());
  estimate.rate_noise_factor = found.rate_noise_factor;
  estimate.force_noise_factor = found.force_noise_factor;
  estimate.num_steps = found.num_steps;
  estimate.num_rejected = found.num_rejected;
  estimate.num_missing = found.num_missing;
}

/// Errors of gravity, the scale factor and the axes' scales compensate each other: their joint deviation from the given
/// values, in σ.
double gravity_sigmas(const ImuState& state, const Imu& given) {
  return std::hypot((state.gravity_in_world.norm() - given.gravity_m_s2) / given.sigma_gravity_m_s2,
                    state.force_scale / given.noise.sigma_force_scale,
                    state.force_axes.diagonal().norm() / given.noise.sigma_axes);
}

/// Largest deviation of the axes from the given ones: of one component, in its σ; `most`: in size.
double axes_sigmas(const ImuState& state, const Imu& given, double& most) {
  most = std::max(state.force_axes.cwiseAbs().maxCoeff(), state.rate_axes.cwiseAbs().maxCoeff());
  const Eigen::Matrix3d rates = state.rate_axes.cwiseAbs();
  const double between = std::max({rates(0, 1), rates(0, 2), rates(1, 2)});  // these have a smaller σ
  return std::max(most, std::numbers::sqrt2 * between) / given.noise.sigma_axes;
}

/// Whether a path with an IMU is usable: its scale is determined, and its noise is plausible.
ImuFault fault_of(const SmoothedImu& found, bool is_in_metres) {
  constexpr double useless = 0.2, any_noise = 30.0;
  if (std::max(found.rate_noise_factor, found.force_noise_factor) > any_noise ||
      2 * found.num_rejected > found.num_steps)
    return ImuFault::misfit;
  return is_in_metres || found.sigma_scale < useless ? ImuFault::none : ImuFault::still;
}

/// Solves a path again with an IMU's rates and forces. Returns metres per former unit.
double solve_with_imu(const Recording& recording, const LocalizeConfig& config, SmootherProblem problem,
                      SmoothedPath& smoothed, Localization& result) {
  if (!config.imu) return 1.0;
  Imu imu = *config.imu;
  imu.readings = without_frozen(std::move(imu.readings));
  ImuAlignment alignment = align_imu(imu, poses_of(problem, smoothed));
  result.imu = alignment.estimate;
  ImuEstimate& estimate = *result.imu;
  estimate.frame_period_s = problem.period_s;
  if (estimate.fault != ImuFault::none) return 1.0;
  const bool has_target = !config.target.points.empty(), is_in_metres = has_target || result.is_scale_read;
  const double scale = is_in_metres ? 1.0 : estimate.scale;
  begin_at(smoothed, scale, problem);
  constexpr double hardly = 1.0;  // relative, of all distances together
  if (!is_in_metres) believe_distances(hardly, problem);
  if (problem.gauge == PathGauge::similarity) problem.gauge = PathGauge::motion;
  problem.imu = imu_to_solve(imu, std::move(alignment), problem.t_s);
  Localization again = result;
  auto with_imu = smooth(problem, recording.frames.frames(), again);
  estimate.fault = with_imu && with_imu->imu ? fault_of(*with_imu->imu, is_in_metres) : ImuFault::unsettled;
  if (with_imu && with_imu->imu) {
    fill_estimate(*with_imu->imu, estimate);
    estimate.gravity_sigmas = gravity_sigmas(with_imu->imu->state, *config.imu);
    estimate.axes_sigmas = axes_sigmas(with_imu->imu->state, *config.imu, estimate.axes_differ);
  }
  if (estimate.fault != ImuFault::none) return 1.0;
  const SmoothedImu& found = *with_imu->imu;
  if (has_target) {
    estimate.scale = 1.0 + found.target_scale;
    estimate.sigma_scale = found.sigma_target;
  } else if (!is_in_metres) {
    estimate.sigma_scale = found.sigma_scale;
  }
  again.imu = estimate;
  result = std::move(again);
  smoothed = std::move(*with_imu);
  result.is_scale_read = result.is_scale_read || !has_target;
  result.scale_known = result.scale_known || !has_target;
  return scale;
}

}  // namespace

std::optional<WholePath> whole_path(const Recording& recording, const LocalizeEngine& engine,
                                    const LocalizeConfig& config, Localization& result) {
  if (!engine.has_begun()) return std::nullopt;
  const KeptFrames& frames = recording.frames;
  Localization kept = result;
  kept.path = frames.steps(result.path);
  auto problem = recording.record.of_every(frames).problem(engine.camera(), config, frames.frames(), kept.path,
                                                           engine.best(), recording.gone, engine.start_without_target(),
                                                           recording.period_s, !recording.number_of.empty());
  if (!problem) return std::nullopt;
  const bool knows_few = recording.record.num_begun() > 1 ||
                         (problem->gauge == PathGauge::similarity && leaves_frames(*problem, frames.frames()));
  const bool lacks_points = !result.is_of_images && knows_few;
  // If less of the lens is requested, the path uses just that.
  const bool frees_lens = result.is_of_images || config.distortion == DistortionVariant::full;
  problem->frees_lens = frees_lens && !lacks_points;
  problem->compares_causes = !result.is_of_images;
  auto smoothed = smooth_with_loops(recording, *problem, kept);
  if (!smoothed) return std::nullopt;
  if (lacks_points || (!result.is_of_images && has_other_lens(*smoothed, *problem)))
    solve_with_remaining(frames.frames(), frees_lens, *problem, *smoothed, kept);
  solve_with_found_sigma(frames.frames(), config, *problem, *smoothed, kept);
  const double by_sensors = solve_in_metres(recording, config, *problem, *smoothed, kept);
  const double scale = by_sensors * solve_with_imu(recording, config, *problem, *smoothed, kept);
  if (kept.imu) kept.imu->scale *= by_sensors;
  std::vector<PathStep> path = std::move(result.path);
  result = std::move(kept);
  frames.put_back(result.path, path);
  result.path = std::move(path);
  result.num_unexplained *= frames.stride();
  result.smoothed_every = frames.stride();
  return WholePath{std::move(*smoothed), problem->first_frame, scale};
}

void take_over(const std::optional<WholePath>& whole, const Recording& recording, const LocalizeEngine& engine,
               const LocalizeConfig& config, Localization& result) {
  if (engine.has_begun())
    for (const GonePoint& each : recording.gone) {
      result.map.push_back(each.point);
      result.map.back().num_seen = recording.num_used(each.point.id);
    }
  if (!whole) return;
  for (MapPoint& point : result.map) {
    point.point_in_world *= whole->scale;
    point.cov *= whole->scale * whole->scale;
  }
  locate_remaining(whole->smoothed, whole->first_frame, recording.frames.frames(), config.filter.sigma_px,
                   config.filter.gate, result.map);
  take_over(whole->smoothed, result);
}

}  // namespace alidade
