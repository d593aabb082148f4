#include "alidade/network/moving_target.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "alidade/geometry/decompositions.h"
#include "alidade/network/camera_fault.h"
#include "alidade/network/moving_given.h"
#include "alidade/network/moving_scale.h"
#include "alidade/network/moving_solve.h"
#include "alidade/network/moving_start.h"

namespace alidade {
namespace {

using PlacedStatus = MovingTargetReport::Status;
constexpr std::size_t min_observations = 30;

struct Placing {
  std::span<const TargetObservation> observations;
  std::span<const RigHead> heads;
  const MovingTargetConfig& config;
  const Progress& progress;
  std::size_t num_better_pairs = 0;  ///< That it does not begin with.
  std::vector<ObservationSeries> series = {};
  double knot_s = 0.0;
  MovingStart start = {};
  std::vector<double> path_t_s = {};  ///< By the clock of the reference.
  MovingProblem problem = {};
  MovingState state = {};
  SolvedMoving solved = {};
  MovingTargetReport report = {};
};

std::optional<std::size_t> head_of(const Placing& work, int id) {
  for (std::size_t h = 0; h < work.heads.size(); ++h)
    if (work.heads[h].head.id == id) return h;
  return std::nullopt;
}

void read_series(Placing& work) {
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    work.series.push_back(observation_series(work.observations, h, work.heads[h]));
    LocatedCamera camera;
    camera.id = work.heads[h].head.id;
    for (const TargetObservation& observation : work.observations) {
      if (observation.head != h) continue;
      if (camera.num_observations++ == 0) work.problem.readings[h] = observation.pan_tilt_rad;
    }
    work.report.cameras.push_back(camera);
  }
  work.knot_s = knot_of(work.series);
}

Rigid3 cam_from_base(Head head, const Eigen::Vector2d& readings_rad) {
  head.world_from_base = Rigid3{};
  return cam_from_world(head, readings_rad);
}

/// The spline through the path of the start, at the work's times.
void set_path(double scale, Placing& work) {
  const std::size_t reference = work.problem.reference;
  const Rigid3& cam_from_start = work.start.cameras[reference].cam_from_world;
  std::vector<Eigen::Vector3d> path;
  for (const Eigen::Vector3d& at : work.start.path) path.emplace_back(scale * (cam_from_start * at));
  // Knots counted from the reference's first observation: the same ones wherever the path is thought to begin.
  const double anchor_s = work.series[reference].t_s.front();
  const double before = std::floor((work.path_t_s.front() - anchor_s) / work.knot_s + 1e-6) - 1.0;
  work.state.path = spline_through(work.path_t_s, path, anchor_s + before * work.knot_s,
                                   work.path_t_s.back() + work.knot_s, work.knot_s);
}

/// World and clock become those of the reference camera; lengths those of the distance given, if there is one.
void set_state(Placing& work) {
  const MovingStart& start = work.start;
  const MovingStart::Placed& first = start.cameras[work.problem.reference];
  const double mid_s = 0.5 * (start.t_s.front() + start.t_s.back());
  const auto in_rig = [&](double t_s) { return t_s + first.offset_s + (first.rate - 1.0) * (t_s - mid_s); };
  work.state.offset_s.clear();
  work.state.drift.clear();
  work.path_t_s.clear();
  const Rigid3 world_from_first = first.cam_from_world.inverse();
  const auto centre = [&](std::size_t h) {
    return Eigen::Vector3d(first.cam_from_world * start.cameras[h].cam_from_world.inverse().translation);
  };
  const double start_m = (centre(work.problem.scale_first) - centre(work.problem.scale_second)).norm();
  const double scale = work.config.distance ? work.config.distance->distance_m / start_m : 1.0;
  work.problem.scale_m = scale * start_m;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    const MovingStart::Placed& camera = start.cameras[h];
    work.state.offset_s.push_back(0.0);
    work.state.drift.push_back(0.0);
    if (!camera.placed) continue;
    Rigid3 world_from_cam = (camera.cam_from_world * world_from_first).inverse();
    world_from_cam.translation *= scale;
    Head& head = work.state.heads[h].head;
    head.world_from_base = world_from_cam * cam_from_base(head, work.problem.readings[h]);
    const double at_s = mid_s + (work.problem.mid_s[h] - camera.offset_s - mid_s) / camera.rate;
    work.state.offset_s[h] = work.problem.mid_s[h] - in_rig(at_s);
    work.state.drift[h] = 1.0 - first.rate / camera.rate;
  }
  for (const double t_s : start.t_s) work.path_t_s.push_back(in_rig(t_s));
  set_path(scale, work);
}

/// Observations where the path is known, four a knot or fewer: each so-and-so many-th of a camera.
void choose_observations(Placing& work) {
  work.problem.observations.clear();
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    if (!work.problem.placed[h]) continue;
    const double spacing_s = std::max(1e-9, work.series[h].spacing_s);
    const auto stride = static_cast<std::size_t>(std::max(1.0, std::ceil(0.24 * work.knot_s / spacing_s - 1e-6)));
    for (std::size_t k = 0; k < work.series[h].t_s.size(); k += stride) {
      const double t_s = work.series[h].t_s[k];
      const double rig_s = work.state.rig_time(work.problem, h, t_s);
      const auto near = std::ranges::lower_bound(work.path_t_s, rig_s - 1.5 * work.knot_s);
      if (near == work.path_t_s.end() || *near > rig_s + 1.5 * work.knot_s) continue;
      work.problem.observations.push_back(
          {work.series[h].observation[k], h, t_s, work.observations[work.series[h].observation[k]].px});
    }
  }
}

void set_problem(Placing& work) {
  MovingProblem& problem = work.problem;
  problem.clocks_are_free = work.config.clock_search_s > 0.0;
  problem.sigma_px = work.config.sigma_px;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    problem.placed.push_back(work.start.cameras[h].placed);
    problem.mid_s.push_back(work.series[h].t_s.empty() ? 0.0 : work.series[h].mid_s());
  }
  problem.reference = static_cast<std::size_t>(std::ranges::find(problem.placed, true) - problem.placed.begin());
  problem.scale_first = work.start.first;
  problem.scale_second = work.start.second;
  if (work.config.distance) {
    const auto first = head_of(work, work.config.distance->first), second = head_of(work, work.config.distance->second);
    if (first && second && problem.placed[*first] && problem.placed[*second]) {
      problem.scale_first = *first;
      problem.scale_second = *second;
      problem.scale_sigma = std::max(1e-4, work.config.distance->sigma_m / work.config.distance->distance_m);
    }
  }
}

[[nodiscard]] bool begin(Placing& work) {
  MovingTargetReport& report = work.report;
  std::size_t num_watching = 0;
  for (const ObservationSeries& one : work.series) num_watching += one.t_s.size() >= min_observations ? 1U : 0U;
  if (num_watching < 2) return false;
  work.start =
      start_cameras(work.series, work.config.clock_search_s, work.knot_s, work.num_better_pairs, work.progress);
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    report.cameras[h].placed = work.start.cameras[h].placed;
    report.cameras[h].reason = work.start.cameras[h].reason;
  }
  if (!work.start.has_common) return false;
  report.status = PlacedStatus::no_pair;
  return work.start.found && work.start.t_s.size() >= min_observations;
}

void take_results(Placing& work) {
  const SolvedMoving& solved = work.solved;
  MovingTargetReport& report = work.report;
  report.rig.heads = solved.state.heads;
  report.used.assign(work.observations.size(), false);
  report.chi2_per_dof = solved.chi2_per_dof;
  report.clusters = solved.clusters;
  report.block_s = solved.block_s;
  report.iterations = solved.iterations;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    LocatedCamera& camera = report.cameras[h];
    if (!camera.placed) continue;
    camera.sigma_px = solved.sigma_px[h];
    const double drift = solved.state.drift[h];
    camera.clock = {drift * work.problem.mid_s[h] - solved.state.offset_s[h], 1.0 - drift};
    const Eigen::Index at = work.problem.first_param(h);
    if (at >= 0 && work.problem.clocks_are_free && solved.cov.size() > 0) {
      camera.sigma_clock_s = std::sqrt(solved.cov(at + 6, at + 6));
      camera.sigma_rate = std::sqrt(solved.cov(at + 7, at + 7));
    }
  }
  std::vector<double> sum2(work.heads.size(), 0.0);
  for (std::size_t i = 0; i < work.problem.observations.size(); ++i) {
    if (!solved.used[i] || !solved.residual_px[i].allFinite()) continue;
    const SolvedObservation& observation = work.problem.observations[i];
    report.used[observation.observation] = true;
    ++report.cameras[observation.head].num_used;
    sum2[observation.head] += solved.residual_px[i].squaredNorm();
  }
  for (std::size_t h = 0; h < work.heads.size(); ++h)
    if (report.cameras[h].num_used > 0)
      report.cameras[h].rms_px = std::sqrt(sum2[h] / static_cast<double>(report.cameras[h].num_used));
  note_rejected(work.problem, solved, report.cameras);
  note_disagreement(work.problem, solved.state, work.series, work.path_t_s, report);
  for (const double t_s : work.path_t_s) {
    const auto at = solved.state.path.support(t_s);
    if (!at) continue;
    report.path_t_s.push_back(t_s);
    report.path.push_back(solved.state.path.position(*at));
  }
}

/// World and clock become the true path's.
void take_truth(Placing& work, const PathMatch& match) {
  MovingTargetReport& report = work.report;
  const Similarity& similarity = match.truth_from_path;
  const Eigen::Quaterniond& turn = similarity.b_from_a.rotation;
  const auto moved = [&](const Eigen::Vector3d& point) {
    return Eigen::Vector3d(similarity.scale * (turn * point) + similarity.b_from_a.translation);
  };
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    if (!report.cameras[h].placed) continue;
    Head& head = report.rig.heads[h].head;
    head.world_from_base = {(turn * head.world_from_base.rotation).normalized(),
                            moved(head.world_from_base.translation)};
    CameraClock& clock = report.cameras[h].clock;
    if (work.problem.clocks_are_free) {
      LocatedCamera& camera = report.cameras[h];
      const double amid_s = work.problem.mid_s[h] - work.solved.state.offset_s[h];
      camera.sigma_clock_s = std::sqrt(camera.sigma_clock_s * camera.sigma_clock_s + match.variance_of_time(amid_s));
      camera.sigma_rate = std::hypot(camera.sigma_rate, std::sqrt(match.cov(8, 8)));
    }
    clock = {match.offset_s + match.rate * clock.offset_s, match.rate * clock.rate};
  }
  for (Eigen::Vector3d& point : report.path) point = moved(point);
  for (double& t_s : report.path_t_s) t_s = match.offset_s + match.rate * t_s;
  report.truth_clock = {match.offset_s, match.rate};
  report.truth_median_m = match.median_m;
  report.truth_rms_m = match.rms_m;
  report.truth_covered = match.covered;
  report.truth_late_s = match.late_s;
  report.sigma_truth_late_s = match.sigma_late_s;
}

void set_scale(Placing& work, const TrueTrack& truth) {
  constexpr double max_misfit = 0.05;  // of the path's extent
  MovingTargetReport& report = work.report;
  if (truth.t_s.empty()) {
    const bool has_scale = work.config.distance && work.problem.scale_sigma > 0.0 &&
                           work.heads[work.problem.scale_first].head.id == work.config.distance->first &&
                           work.heads[work.problem.scale_second].head.id == work.config.distance->second;
    report.status = has_scale ? PlacedStatus::placed : PlacedStatus::no_scale;
    take_covariance(work.problem, moving_given(work.problem, work.solved, work.config), work.solved.cov_model, nullptr,
                    report);
    report.sigma_scale = work.problem.scale_sigma;
    return;
  }
  const auto match = match_path(report.path_t_s, report.path, truth, work.config.clock_search_s > 0.0);
  if (!match || match->median_m > max_misfit * match->extent_m) {
    report.status = PlacedStatus::truth_misfits;
    TrueTrack mirrored = truth;
    for (Eigen::Vector3d& position : mirrored.position) position.x() *= -1.0;
    const auto other = match_path(report.path_t_s, report.path, mirrored, work.config.clock_search_s > 0.0);
    if (other && other->median_m <= max_misfit * other->extent_m)
      report.camera_fault = "the path that was seen is the true one mirrored: the images of all cameras are mirrored";
    return;
  }
  take_truth(work, *match);
  take_covariance(work.problem, moving_given(work.problem, work.solved, work.config), work.solved.cov_model, &*match,
                  report);
  report.status = PlacedStatus::placed;
}

/// The start of a second solve: what the first one found, the path and its observations again. The knots, the
/// observations that are taken and the loose path no longer depend on how the search for a start went.
void restart(Placing& work) {
  const MovingState& state = work.solved.state;
  MovingStart& start = work.start;
  start.t_s = work.path_t_s;
  start.path.clear();
  const double mid_s = 0.5 * (start.t_s.front() + start.t_s.back());
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    MovingStart::Placed& camera = start.cameras[h];
    if (!camera.placed) continue;
    camera.cam_from_world = cam_from_world(state.heads[h].head, work.problem.readings[h]);
    camera.rate = 1.0 / (1.0 - state.drift[h]);
    camera.offset_s = (mid_s + state.offset_s[h] - state.drift[h] * work.problem.mid_s[h]) * camera.rate - mid_s;
  }
  for (const double t_s : start.t_s) {
    const auto at = state.path.support(t_s);
    start.path.push_back(at ? state.path.position(*at) : Eigen::Vector3d::Zero());
  }
  start.first = work.problem.reference;
  rebuild_path(work.series, work.knot_s, start);
}

void place(Placing& work, const TrueTrack& truth) {
  work.state.heads.assign(work.heads.begin(), work.heads.end());
  work.report.rig.heads = work.state.heads;
  work.problem.readings.assign(work.heads.size(), Eigen::Vector2d::Zero());
  read_series(work);
  if (!begin(work)) return;
  work.report.status = PlacedStatus::degenerate;
  if (is_line(work.series, min_observations)) return;
  set_problem(work);
  int iterations = 0;
  for (const bool is_again : {false, true}) {
    if (is_again) restart(work);
    set_state(work);
    choose_observations(work);
    work.solved = solve_moving(work.problem, work.state, work.progress, !is_again);
    work.solved.iterations += std::exchange(iterations, work.solved.iterations);
    if (work.solved.cov.size() == 0) break;
  }
  take_results(work);
  const bool is_given = work.solved.cov.size() > 0;
  // By wrong times, rays meet in a short piece of path at most, which determines no positions: it is not the path's
  // fault.
  const ObservationSeries& watching = work.series[work.problem.reference];
  const bool fits = 2.0 * static_cast<double>(work.path_t_s.size()) * work.knot_s >
                    static_cast<double>(watching.t_s.size()) * watching.spacing_s;
  if (!is_given && (fits || work.problem.clocks_are_free)) return;
  work.report.status = PlacedStatus::no_convergence;
  if (is_given && work.solved.converged) set_scale(work, truth);
}

double first_time(std::span<const TargetObservation> observations) {
  const auto first = std::ranges::min_element(observations, {}, &TargetObservation::t_capture_s);
  return first == observations.end() ? 0.0 : first->t_capture_s;
}

/// Times from the first observation on, to the nanosecond: what is added to all times must not round its way into the
/// answer.
std::vector<TargetObservation> moved_to(double origin_s, std::span<const TargetObservation> observations) {
  std::vector<TargetObservation> moved(observations.begin(), observations.end());
  for (TargetObservation& observation : moved)
    observation.t_capture_s = 1e-9 * std::round(1e9 * (observation.t_capture_s - origin_s));
  return moved;
}

void move_back(double origin_s, MovingTargetReport& report) {
  const auto move = [origin_s](CameraClock& clock) { clock.offset_s += origin_s * (1.0 - clock.rate); };
  for (LocatedCamera& camera : report.cameras) {
    if (camera.placed) move(camera.clock);
    if (camera.moved) camera.moved->t_s += origin_s;
  }
  move(report.truth_clock);
  if (report.disagree) report.disagree->t_s += origin_s;
  for (double& t_s : report.path_t_s) t_s += origin_s;
}

}  // namespace

MovingTargetReport place_cameras(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                 const MovingTargetConfig& config, const TrueTrack& truth, const Progress& progress) {
  const double origin_s = first_time(observations);
  const std::vector<TargetObservation> from_origin = moved_to(origin_s, observations);
  TrueTrack truth_from_origin = truth;
  for (double& t_s : truth_from_origin.t_s) t_s -= origin_s;
  const auto placed = [&](std::span<const TargetObservation> some, std::span<const RigHead> given,
                          const TrueTrack& path, const MovingTargetConfig& with, std::size_t num_better_pairs = 0) {
    Placing work{some, given, with, progress, num_better_pairs};
    place(work, path);
    return std::move(work.report);
  };
  MovingTargetReport report = placed(from_origin, heads, truth_from_origin, config);
  // A short path allows more than one start; by some of them no path fits, though there is one.
  constexpr std::size_t max_starts = 3;
  for (std::size_t k = 1; k < max_starts && heads.size() > 2 && config.clock_search_s == 0.0 && is_doubtful(report);
       ++k)
    if (auto other = placed(from_origin, heads, truth_from_origin, config, k); agrees_better(other, report))
      report = std::move(other);
  constexpr double max_search_s = 30.0;  // of clocks that are farther apart, each trial takes minutes
  if (report.camera_fault.empty() && config.clock_search_s <= max_search_s)
    report.camera_fault = camera_fault_of(
        report, from_origin, heads, config.clock_search_s,
        [&](const std::vector<TargetObservation>& some, const std::vector<RigHead>& given, double clock_search_s) {
          MovingTargetConfig with = config;
          with.clock_search_s = clock_search_s;
          return placed(some, given, {}, with);
        });
  move_back(origin_s, report);
  return report;
}

}  // namespace alidade
