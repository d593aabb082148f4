#pragma once

#include <functional>
#include <vector>

#include "alidade/observe/filters/hybrid.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/rotation_sample.h"

namespace alidade::testing {

// The paper's camera, image and start (28); points drawn again for each set; noise σ² = 0.1 px² on every coordinate.

struct Experiment {
  RotationScene scene;
  RotationLogConfig log;
  ObserveNuisances estimate;
  std::function<void(RotationLog&, int set)> disturb = [](RotationLog&, int) {};
};

inline Experiment paper_experiment(double duration_s) {
  Experiment experiment;
  experiment.scene.motion = paper_rate;
  experiment.log.duration_s = duration_s;
  return experiment;
}

inline RotationLog log_of(Experiment& experiment, int set) {
  experiment.scene.start_px = draw_points(780, 582, 4, 1000 + static_cast<std::uint64_t>(set));
  RotationLog log = simulate_rotation(experiment.scene, experiment.log, static_cast<std::uint64_t>(set) + 1);
  experiment.disturb(log, set);
  return log;
}

inline HybridObserver paper_observer(const ObserveNuisances& estimate = {}, double sigma_px = 0.0) {
  HybridConfig config;
  config.num_points = 4;
  config.scale = paper_scale;
  config.start.k = {500.0 / 400.0, 510.0 / 400.0, 10.0 / 400.0, 9.0 / 400.0};
  config.start_is_given = true;
  config.nuisances = estimate;
  config.sigma_px = sigma_px;
  return HybridObserver(config);
}

using Watch =
    std::function<void(std::size_t row, const RotationRow&, const Eigen::Vector4d& error, const IntrinsicsEstimate&)>;

inline void run(const Experiment& experiment, const RotationLog& log, const Watch& watch) {
  HybridObserver observer = paper_observer(experiment.estimate);
  MotionReader reader(log.source, 0.25);
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const IntrinsicsEstimate estimate = observer.step(reader.next(log.rows[k]));
    const TrueIntrinsics& truth = log.truth[k];
    watch(k, log.rows[k], estimate.values() - Eigen::Vector4d(truth[0], truth[1], truth[2], truth[3]), estimate);
  }
}

/// Cramér–Rao bound of the first `rows` rows: σ of fx, fy, cx, cy at the truth, by the information of all pixels.
inline Eigen::Vector4d bound_of(const Experiment& experiment, const RotationLog& log, std::size_t rows) {
  RotationBundle bundle;
  const TrueIntrinsics& truth = log.truth.front();
  bundle.camera.k = {truth[0] / 400.0, truth[1] / 400.0, (truth[2] - 390.0) / 400.0, (truth[3] - 291.0) / 400.0};
  for (const Eigen::Vector2d& px : experiment.scene.start_px) {
    BearingPoint point;
    point.ab = {(px.x() - truth[2]) / truth[0], (px.y() - truth[3]) / truth[1]};
    bundle.points.push_back(point);
  }
  MotionReader reader(log.source, 0.25);
  for (std::size_t k = 0; k < rows; ++k) {
    bundle.frames.push_back(reader.next(log.rows[k]));
    for (int i = 0; i < 4; ++i) {
      bundle.observations.push_back(
          {static_cast<int>(k), i, paper_scale.normalised(log.rows[k].px[static_cast<std::size_t>(i)])});
    }
  }
  RotationBundleConfig config;
  config.sigma_px = experiment.log.sigma_px / 400.0;
  config.huber = 0.0;
  config.max_iterations = 0;
  const BundleSolution solution = solve_rotation_bundle(bundle, CommonPrior(bundle.camera), config);
  return solution.bound().diagonal().head<4>().cwiseSqrt() * 400.0;
}

}  // namespace alidade::testing
