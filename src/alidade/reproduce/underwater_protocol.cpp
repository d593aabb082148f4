#include "alidade/reproduce/underwater_protocol.h"

#include <Eigen/LU>
#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

#include "alidade/board_detector/find_boards.h"

namespace alidade::reproduce {

UnderwaterSample underwater_sample(const UnderwaterScene& scene, std::uint64_t seed) {
  const UnderwaterSequence sequence = simulate_underwater(scene, seed);
  UnderwaterSample sample;
  sample.camera = scene.camera;
  for (const UnderwaterFrame& frame : sequence.frames) {
    ObservationFrame seen{static_cast<long>(sample.frames.size()), frame.t_s, {}};
    for (const UnderwaterObservation& observation : frame.observations)
      seen.observations.push_back({observation.id, observation.px, 0.0});
    sample.frames.push_back(std::move(seen));
    sample.truth.push_back({frame.t_s, frame.world_from_cam});
  }
  LocalizeStart start;
  start.motion.world_from_cam = sequence.given_start;
  start.cov.diagonal().head<3>().setConstant(scene.sigma_position_m * scene.sigma_position_m);
  start.cov.diagonal().segment<3>(3).setConstant(scene.sigma_rotation_rad * scene.sigma_rotation_rad);
  start.cov.diagonal().tail<6>().setConstant(0.3 * 0.3);
  sample.config.start = start;
  for (const UnderwaterPoint& point : sequence.points) {
    sample.points[point.id] = point.point_in_world;
    if (point.is_known)
      sample.config.target.points.push_back({point.id, point.given_in_world, scene.sigma_known_m});
    else if (point.given_depth_m > 0.0)
      sample.config.start->depths.push_back({point.id, point.given_depth_m, scene.sigma_depth});
  }
  return sample;
}

namespace {

/// What of the board's points was found in an image.
std::vector<FeatureObservation> observations_of_board(const BoardDetection& detection) {
  std::vector<FeatureObservation> observations;
  for (const Corner& corner : detection.view.corners)
    if (const auto id = underwater_point_at(corner.index))
      observations.push_back({*id, corner.px, std::sqrt(0.5 * corner.cov.trace())});
  return observations;
}

/// Where a point is first seen, its true depth there. 0: never.
double first_depth_m(const UnderwaterSample& sample, long id) {
  for (std::size_t k = 0; k < sample.frames.size(); ++k)
    if (std::ranges::count(sample.frames[k].observations, id, &FeatureObservation::id) > 0)
      return (sample.truth[k].world_from_cam.inverse() * sample.points.at(id)).z();
  return 0.0;
}

}  // namespace

UnderwaterSample filmed_sample(const UnderwaterScene& scene, const UnderwaterVideoConfig& video, std::uint64_t seed) {
  UnderwaterSample sample = underwater_sample(scene, seed);
  for (GivenDepth& given : sample.config.start->depths) given.depth_m /= first_depth_m(sample, given.id);
  const auto film = [&](std::size_t k) {
    return render_underwater_frame(scene.camera, sample.truth[k].world_from_cam, video, 1000 * seed + k);
  };
  const BoardDetections found = find_boards(sample.frames.size(), film, underwater_board());
  for (std::size_t k = 0; k < sample.frames.size(); ++k)
    sample.frames[k].observations = observations_of_board(found.photos[k]);
  // As wrong as before, of the depth at which the images show a point first.
  for (GivenDepth& given : sample.config.start->depths) given.depth_m *= first_depth_m(sample, given.id);
  return sample;
}

UnderwaterSample with_even_noise(UnderwaterSample sample) {
  for (ObservationFrame& frame : sample.frames)
    for (FeatureObservation& observation : frame.observations) observation.sigma_px = 0.0;
  return sample;
}

ObservationErrors observation_errors(const UnderwaterSample& sample) {
  ObservationErrors errors;
  double sum2 = 0.0, chi2 = 0.0;
  for (std::size_t k = 0; k < sample.frames.size(); ++k) {
    for (const FeatureObservation& observation : sample.frames[k].observations) {
      const auto px =
          project(sample.camera, sample.truth[k].world_from_cam.inverse() * sample.points.at(observation.id));
      const double error2 = px ? (observation.px - *px).squaredNorm() : INFINITY;
      sum2 += error2;
      chi2 += error2 / (observation.sigma_px * observation.sigma_px);
      ++errors.num;
    }
  }
  const double dof = 2.0 * static_cast<double>(errors.num);
  return {std::sqrt(sum2 / dof), chi2 / dof, errors.num};
}

PointError point_error(const UnderwaterSample& sample, long id, const Eigen::Vector3d& is, const Eigen::Matrix3d& cov) {
  const Eigen::Vector3d error = is - sample.points.at(id);
  const double distance = (sample.points.at(id) - sample.truth.front().world_from_cam.translation).norm();
  return {100.0 * error.norm() / distance, error.dot(cov.inverse() * error) / 3.0};
}

namespace {

PointError error_of(const UnderwaterSample& sample, const LocalizationFilter& filter, long id) {
  const auto place = filter.place(id);
  return place ? point_error(sample, id, place->point_in_world, place->cov) : PointError{100.0, 100.0};
}

/// What stands in the last frame.
void add_last_frame(const UnderwaterSample& sample, const LocalizationFilter& filter, ProtocolRun& run) {
  run.p1_last = error_of(sample, filter, 1).percent;
  run.p5_last = error_of(sample, filter, 5).percent;
  run.p1_nees = error_of(sample, filter, 1).nees;
  run.p5_nees = error_of(sample, filter, 5).nees;
  run.worst_last = 0.0;
  for (const auto& [id, point_in_world] : sample.points)
    run.worst_last = std::max(run.worst_last, error_of(sample, filter, id).percent);
  const Rigid3& world_from_cam = filter.motion().world_from_cam;
  run.camera_mm = 1e3 * (world_from_cam.translation - sample.truth.back().world_from_cam.translation).norm();
  run.camera = filter.camera();
  run.sigma_lens = filter.lens_sigmas();
}

}  // namespace

ProtocolRun run_protocol(const UnderwaterSample& sample, const Camera& camera, const LocalizationFilterConfig& filter,
                         const FilterBankConfig& bank_config, FeatureKind kind) {
  LocalizeConfig config = sample.config;
  config.filter = filter;
  config.bank = bank_config;
  config.new_points = kind == FeatureKind::xyz ? NewPoints::xyz : NewPoints::inverse_depth;
  config.restarts = filter.finds_consensus;
  ProtocolRun run;
  run.p1_last = run.p5_last = run.worst_last = 100.0;  // where nothing ever starts
  config.inspect = [&](const LocalizationFilter& now) {
    run.p1_percent.push_back(error_of(sample, now, 1).percent);
    run.p5_percent.push_back(error_of(sample, now, 5).percent);
    add_last_frame(sample, now, run);
  };
  const Localization report = localize(sample.frames, camera, config);
  for (auto* percent : {&run.p1_percent, &run.p5_percent})  // frames before the start
    percent->insert(percent->begin(), sample.frames.size() - percent->size(), 100.0);
  for (const PathStep& step : report.path)
    if (step.num_tracked > 0) run.nis_per_dof += step.nis_per_dof / static_cast<double>(report.path.size());
  constexpr std::size_t first = 10;
  const double num = static_cast<double>(sample.frames.size() - first);
  for (std::size_t k = first; k < sample.frames.size(); ++k) {
    run.p1_mean += run.p1_percent[k] / num;
    run.p5_mean += run.p5_percent[k] / num;
    run.p1_above_2 += run.p1_percent[k] > 2.0 ? 1.0 / num : 0.0;
  }
  return run;
}

LocalizationFilterConfig paper_filter() {
  LocalizationFilterConfig config;
  config.is_sequential = config.finds_consensus = config.holds_frame = false;
  config.gate = 1e9;
  config.curvature_tolerance = 0.0;  // always four steps
  config.state_capacity = 80;
  config.observations_capacity = 16;
  return config;
}

LocalizationFilterConfig recommended_filter() {
  LocalizationFilterConfig config;
  config.state_capacity = 80;
  config.observations_capacity = 16;
  return config;
}

}  // namespace alidade::reproduce
