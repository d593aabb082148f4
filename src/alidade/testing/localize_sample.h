#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <map>
#include <vector>

#include "alidade/localize/distortion.h"
#include "alidade/localize/localize.h"
#include "alidade/simulate/underwater.h"

namespace alidade::testing {

/// A simulated sequence as a filter is given it, with its truth.
struct UnderwaterSample {
  Camera camera;
  std::vector<SightFrame> frames;
  std::vector<TimedPose> truth;
  LocalizeConfig config;
  std::map<long, Eigen::Vector3d> points;
};

[[nodiscard]] inline UnderwaterSample underwater_sample(const UnderwaterScene& scene, std::uint64_t seed) {
  const UnderwaterSequence sequence = simulate_underwater(scene, seed);
  UnderwaterSample sample;
  sample.camera = scene.camera;
  for (const UnderwaterFrame& frame : sequence.frames) {
    SightFrame seen{static_cast<long>(sample.frames.size()), frame.t_s, {}};
    for (const UnderwaterSight& sight : frame.sights) seen.sights.push_back({sight.id, sight.px, 0.0});
    sample.frames.push_back(std::move(seen));
    sample.truth.push_back({frame.t_s, frame.world_from_cam});
  }
  StartHypothesis start;
  start.motion.world_from_cam = sequence.told_start;
  start.cov.diagonal().head<3>().setConstant(scene.sigma_position_m * scene.sigma_position_m);
  start.cov.diagonal().segment<3>(3).setConstant(scene.sigma_rotation_rad * scene.sigma_rotation_rad);
  start.cov.diagonal().tail<6>().setConstant(0.3 * 0.3);
  sample.config.start = start;
  for (const UnderwaterPoint& point : sequence.points) {
    sample.points[point.id] = point.point_in_world;
    if (point.is_known)
      sample.config.target.push_back({point.id, point.told_in_world, scene.sigma_known_m});
    else if (point.told_depth_m > 0.0)
      sample.config.depths.push_back({point.id, point.told_depth_m, scene.sigma_depth});
  }
  return sample;
}

/// A point of the map against the truth.
struct PointError {
  double percent = 0.0;  ///< 100 |ŷ − y| over the distance from the first camera.
  double nees = 0.0;     ///< eᵀ P⁻¹ e / 3.
};

[[nodiscard]] inline PointError point_error(const UnderwaterSample& sample, long id, const Eigen::Vector3d& is,
                                            const Eigen::Matrix3d& cov) {
  const Eigen::Vector3d error = is - sample.points.at(id);
  const double distance = (sample.points.at(id) - sample.truth.front().world_from_cam.translation).norm();
  return {100.0 * error.norm() / distance, error.dot(cov.inverse() * error) / 3.0};
}

/// One run of the protocol on page docs/maths/localization.md: errors of points 1 and 5, and of the camera.
struct ProtocolRun {
  double p1_last = 0.0, p1_mean = 0.0, p5_last = 0.0, p5_mean = 0.0;  ///< [%], means over frames 10 to the end.
  double p1_above_2 = 0.0;  ///< Share of these frames with point 1 more than 2 % off.
  double p1_nees = 0.0, p5_nees = 0.0, worst_last = 0.0, camera_mm = 0.0, nis_per_dof = 0.0;
  Camera camera;
  Eigen::VectorXd sigma_lens;
};

/// Drives the bank itself, frame by frame, so that points can be judged on the way.
[[nodiscard]] inline ProtocolRun run_protocol(const UnderwaterSample& sample, const Camera& camera,
                                              const LocalizationFilterConfig& filter,
                                              const FilterBankConfig& bank_config, FeatureKind kind) {
  const StartHypothesis start = *sample.config.start;
  FilterBank bank(camera, {&start, 1}, filter, bank_config);
  for (const KnownPoint& point : sample.config.target) bank.add_known(point.id, point.point_in_world, point.sigma_m);
  ProtocolRun run;
  const auto error_of = [&](long id) {
    const auto place = bank.best().place(id);
    return place ? point_error(sample, id, place->point_in_world, place->cov) : PointError{100.0, 100.0};
  };
  double num = 0.0;
  for (std::size_t k = 0; k < sample.frames.size(); ++k) {
    const SightFrame& frame = sample.frames[k];
    if (k > 0) bank.predict(frame.t_s - sample.frames[k - 1].t_s);
    run.nis_per_dof += bank.update(frame.sights).nis_per_dof / static_cast<double>(sample.frames.size());
    for (const FeatureSight& sight : frame.sights) {
      const auto told = std::ranges::find(sample.config.depths, sight.id, &ToldDepth::id);
      const auto ray_in_cam = unproject(bank.best().camera(), sight.px);
      if (bank.best().has(sight.id) || told == sample.config.depths.end() || !ray_in_cam) continue;
      bank.add(sight.id, sight.px, {told->depth_m / ray_in_cam->z(), told->sigma_rel}, kind);
    }
    bank.convert_linear();
    if (k < 10) continue;
    const double p1 = error_of(1).percent;
    run.p1_mean += p1;
    run.p5_mean += error_of(5).percent;
    run.p1_above_2 += p1 > 2.0 ? 1.0 : 0.0;
    num += 1.0;
  }
  run.p1_mean /= num;
  run.p5_mean /= num;
  run.p1_above_2 /= num;
  run.p1_last = error_of(1).percent;
  run.p5_last = error_of(5).percent;
  run.p1_nees = error_of(1).nees;
  run.p5_nees = error_of(5).nees;
  for (const auto& [id, point_in_world] : sample.points)
    run.worst_last = std::max(run.worst_last, error_of(id).percent);
  const Rigid3& world_from_cam = bank.best().motion().world_from_cam;
  run.camera_mm = 1e3 * (world_from_cam.translation - sample.truth.back().world_from_cam.translation).norm();
  run.camera = bank.best().camera();
  run.sigma_lens = bank.best().lens_sigmas();
  return run;
}

/// The published filter of the protocol: places, all sights of a frame at once, iterated, one start, no gate.
[[nodiscard]] inline LocalizationFilterConfig paper_filter() {
  LocalizationFilterConfig config;
  config.is_sequential = config.finds_consensus = false;
  config.gate = 1e9;
  config.bend_tolerance = 0.0;  // always four steps
  config.state_capacity = 80;
  config.sights_capacity = 16;
  return config;
}

/// The recommended one for so few points.
[[nodiscard]] inline LocalizationFilterConfig recommended_filter() {
  LocalizationFilterConfig config;
  config.state_capacity = 80;
  config.sights_capacity = 16;
  return config;
}

}  // namespace alidade::testing
