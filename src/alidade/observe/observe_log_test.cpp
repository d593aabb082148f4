#include <gtest/gtest.h>

#include <cmath>

#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/rotation.h"

// What a log may bring beside rotation and pixels: noise of the rotation, a measured velocity, a gap.

namespace alidade {
namespace {

RotationScene scene_of(std::uint64_t seed) {
  RotationScene scene;
  scene.start_px = draw_points(780, 582, 6, seed);
  scene.motion = paper_rate;
  return scene;
}

ObserveSetup config_of() {
  ObserveSetup config;
  config.width_px = 780;
  config.height_px = 582;
  return config;
}

Eigen::Vector4d errors_of(const ObserveSolution& report) {
  const double truth[] = {710.0, 700.0, 390.0, 290.0};
  Eigen::Vector4d errors;
  for (int i = 0; i < 4; ++i) errors[i] = report.quantities[static_cast<std::size_t>(i)].value - truth[i];
  return errors;
}

/// A head on the paper's course whose encoders have noise.
RotationLog noisy_head_log(RotationScene scene, double rate_hz, double duration_s, double sigma_angle_rad,
                           std::uint64_t seed) {
  scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.rate_hz = rate_hz;
  config.duration_s = duration_s;
  config.sigma_angle_rad = sigma_angle_rad;
  return simulate_rotation(scene, config, seed);
}

ObserveSetup noisy_head_config(double sigma_angle_rad) {
  ObserveSetup config = config_of();
  config.rotation = RotationKnowledge::noisy;
  config.sigma_angle_rad = sigma_angle_rad;
  return config;
}

/// What the filter ends at is compared with all rows together, also where nothing of the last row is seen or fits:
/// there it once was not, and stood 9σ off.
TEST(ObserveLog, TheEndOfALogIsComparedWithAllRowsWhateverItsLastRowIs) {
  const auto distance_after = [](const auto& change) {
    RotationLogConfig log_config;
    log_config.duration_s = 12.0;
    RotationLog log = simulate_rotation(scene_of(3), log_config, 3);
    change(log.rows.back());
    ObserveSetup config = config_of();
    config.no_zoom = true;
    const ObserveSolution report = solve_intrinsics(log, config);
    EXPECT_EQ(report.status, ObserveSolution::Status::ok);
    return report.from_reference;
  };
  const double as_it_is = distance_after([](RotationRow&) {});
  EXPECT_GT(as_it_is, 0.0);
  EXPECT_GT(distance_after([](RotationRow& last) {
              for (Eigen::Vector2d& px : last.px) px += Eigen::Vector2d(40.0, -30.0);
            }),
            0.1 * as_it_is);
  EXPECT_GT(distance_after([](RotationRow& last) {
              for (Eigen::Vector2d& px : last.px) px.setConstant(not_seen);
            }),
            0.1 * as_it_is);
}

/// A camera centre 20 mm from the centre of rotation moves; measured, its velocity takes the bias away as a given lever
/// arm does. It is ω × r in the camera's frame.
TEST(ObserveLog, AMeasuredVelocityTakesTheBiasOfTranslationAway) {
  const Eigen::Vector3d lever_m(0.0, 0.0, 0.02);
  Eigen::Vector4d with = Eigen::Vector4d::Zero(), without = Eigen::Vector4d::Zero();
  constexpr int sets = 30;
  for (std::uint64_t seed = 1; seed <= sets; ++seed) {
    RotationScene scene = scene_of(seed);
    scene.lever_arm_m = lever_m;
    scene.depth_m.assign(6, 2.0);
    RotationLogConfig log_config;
    log_config.duration_s = 6.0;
    log_config.with_range = true;
    log_config.sigma_range_m = 0.002;
    RotationLog log = simulate_rotation(scene, log_config, seed);
    const ObserveSolution blind = solve_intrinsics(log, config_of());
    log.has_velocity = true;
    for (RotationRow& row : log.rows) row.velocity_m_per_s = row.rate_rad_per_s.cross(lever_m);
    const ObserveSolution given = solve_intrinsics(log, config_of());
    ASSERT_EQ(given.status, ObserveSolution::Status::ok);
    with += errors_of(given) / sets;
    without += errors_of(blind) / sets;
  }
  EXPECT_GT(without.head<2>().cwiseAbs().maxCoeff(), 4.0);  // f r / Z = 7 px
  EXPECT_LT(with.head<2>().cwiseAbs().maxCoeff(), 0.3);
}

/// Encoders with 0.2 mrad of noise, 0.14 px: taken for exact, σ is too small; given, it covers.
TEST(ObserveLog, NoisyRotationIsEstimatedWithTheRest) {
  int inside = 0, counted = 0;
  for (std::uint64_t seed = 1; seed <= 12; ++seed) {
    const RotationLog log = noisy_head_log(scene_of(seed), 15.0, 6.0, 5e-4, seed);
    const ObserveSetup config = noisy_head_config(5e-4);
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok);
    const Eigen::Vector4d errors = errors_of(report);
    for (int i = 0; i < 4; ++i) {
      inside += std::abs(errors[i]) < 2.0 * report.quantities[static_cast<std::size_t>(i)].sigma;
      ++counted;
    }
  }
  // 95 % of 48, less three standard errors.
  EXPECT_GE(static_cast<double>(inside) / counted, 0.954 - 3.0 * std::sqrt(0.954 * 0.046 / counted));
}

/// All rows of a long log count: σ falls with the root of their number, and covers.
TEST(ObserveLog, NoisyRotationsOfALongLogAllCount) {
  int inside = 0, counted = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    RotationLog log = noisy_head_log(scene_of(seed), 25.0, 60.0, 5e-4, seed);
    const ObserveSetup config = noisy_head_config(5e-4);
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok);
    const Eigen::Vector4d errors = errors_of(report);
    for (int i = 0; i < 4; ++i, ++counted)
      inside += std::abs(errors[i]) < 2.0 * report.quantities[static_cast<std::size_t>(i)].sigma;
    const double sigma = report.quantities[0].sigma_model;
    log.rows.resize(240);
    log.truth.resize(240);
    const ObserveSolution first = solve_intrinsics(log, config);
    EXPECT_LT(sigma, 1.25 * std::sqrt(240.0 / 1501.0) * first.quantities[0].sigma_model) << "seed " << seed;
  }
  EXPECT_GE(static_cast<double>(inside) / counted, 0.954 - 3.0 * std::sqrt(0.954 * 0.046 / counted));
}

/// A head's angles are read more often than there are frames: rows without pixels are no frames to adjust.
TEST(ObserveLog, NoisyRotationsBetweenFramesAreNoFrames) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    RotationScene scene = scene_of(seed);
    scene.delay_s = -0.04;
    scene.mount_rad = {0.035, -0.017, 0.017};
    RotationLog log = noisy_head_log(scene, 30.0, 60.0, 5e-5, seed);
    for (std::size_t k = 0; k < log.rows.size(); ++k) {
      if (k % 3 != 2) std::ranges::fill(log.rows[k].px, Eigen::Vector2d::Constant(not_seen));
    }
    ObserveSetup config = noisy_head_config(5e-5);
    config.estimate = {"k1", "mount", "delay"};
    config.nuisances.k1 = config.nuisances.mount = config.nuisances.delay = true;
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok) << "seed " << seed;
    EXPECT_EQ(report.reference.bundle.frames.size(), 600u);
    const Eigen::Vector4d errors = errors_of(report);
    for (int i = 0; i < 4; ++i)
      EXPECT_LT(std::abs(errors[i]), 4.0 * report.quantities[static_cast<std::size_t>(i)].sigma) << "seed " << seed;
  }
}

/// What the check of the rotations' noise advises where the given σ is too small is the true one, at once.
TEST(ObserveLog, NoiseOfRotationsIsAdvisedAsItIs) {
  for (const double given_rad : {1e-4, 2e-4, 5e-4}) {
    double ratio = 0.0;
    constexpr int sets = 4;
    for (std::uint64_t seed = 1; seed <= sets; ++seed) {
      const RotationLog log = noisy_head_log(scene_of(seed), 15.0, 20.0, 5e-4, seed);
      const ObserveSetup config = noisy_head_config(given_rad);
      const ObserveSolution report = solve_intrinsics(log, config);
      const Verdict verdict = observe_verdict(report, log, config);
      const auto check = std::ranges::find(verdict.checks, "rotation's noise", &Check::name);
      ASSERT_NE(check, verdict.checks.end());
      EXPECT_EQ(check->state == State::good, given_rad > 4e-4) << given_rad;
      ratio += check->value / sets;
    }
    EXPECT_NEAR(ratio * given_rad, 5e-4, 0.1 * 5e-4) << given_rad;
  }
}

/// A rate about an axis that does not turn is its noise: to take the noise away is no scale of -1.
TEST(ObserveLog, NoisyRatesHaveNoScaleOfTheirNoise) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    RotationScene scene = scene_of(seed);
    scene.motion = [](double t_s) { return Eigen::Vector3d(paper_rate(t_s).x(), paper_rate(t_s).y(), 0.0); };
    RotationLogConfig log_config;
    log_config.duration_s = 20.0;
    log_config.sigma_rate_rad_per_s = 0.003;
    const RotationLog log = simulate_rotation(scene, log_config, seed);
    ObserveSetup config = config_of();
    config.rotation = RotationKnowledge::noisy;
    config.sigma_rate_rad_per_s = 0.003;
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok);
    ASSERT_FALSE(report.causes.empty());
    for (const CauseScore& cause : report.causes) EXPECT_LT(cause.z, 5.0) << cause.name << ", seed " << seed;
  }
}

/// Rates were lost for a second: the rotation across it is not known, the points are met again, the estimate goes on.
TEST(ObserveLog, AGapOfTheRatesBeginsASegmentAndNothingBreaks) {
  for (std::uint64_t seed = 1; seed <= 10; ++seed) {
    RotationLogConfig log_config;
    log_config.duration_s = 9.0;
    RotationLog log = simulate_rotation(scene_of(seed), log_config, seed);
    std::erase_if(log.rows, [](const RotationRow& row) { return row.t_s > 4.0 && row.t_s < 5.0; });
    log.truth.resize(log.rows.size());
    const ObserveSolution report = solve_intrinsics(log, config_of());
    ASSERT_EQ(report.status, ObserveSolution::Status::ok);
    const bool has_gap = std::any_of(report.events.begin(), report.events.end(),
                                     [](const ObserveNote& note) { return note.event == ObserveEvent::new_segment; });
    EXPECT_TRUE(has_gap);
    const Eigen::Vector4d errors = errors_of(report);
    for (int i = 0; i < 4; ++i)
      EXPECT_LT(std::abs(errors[i]), 4.0 * report.quantities[static_cast<std::size_t>(i)].sigma) << "seed " << seed;
  }
}

}  // namespace
}  // namespace alidade
