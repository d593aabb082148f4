#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>

#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/trials.h"

// What is not as assumed is estimated where the data carry it. Nothing wrong is ever silent.
// ALIDADE_TEST_TRIALS=20 draws as many logs of each cause.

namespace alidade {
namespace causes_of_observe {

constexpr int image_width = 1280, image_height = 720;

/// Draws of each cause: 2, or as many as ALIDADE_TEST_TRIALS says.
const int sets = testing::trials(2);

/// All but one in ten.
int nearly_all() { return sets - sets / 10; }

/// Three standard errors of a share of 95 %: of 20 draws with four values each, 2.4 %.
double margin_of_two() { return 3.0 * 2.4 * std::sqrt(20.0 / sets); }
const Eigen::Vector4d true_k(1000.0, 990.0, 636.0, 363.0);

/// A world and what is wrong with it.
struct World {
  RotationSource source = RotationSource::head;
  std::function<void(RotationScene&, RotationLogConfig&, Draws&)> scene = [](auto&, auto&, auto&) {};
  RotationFaults faults;
  std::function<void(RotationLog&)> measured = [](auto&) {};  ///< What else is wrong with it.
  bool gives_scale = false;                                   ///< The log says that its scale and its centre are exact.
};

RotationLog log_in(const World& world, std::uint64_t seed) {
  Draws draws(5000 + seed);
  RotationScene scene;
  scene.width_px = image_width;
  scene.height_px = image_height;
  scene.start_px = draw_points(image_width, image_height, 12, 300 + seed);
  scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3]}; };
  std::array<double, 4> rate{}, phase{};
  for (std::size_t i = 0; i < 4; ++i) {
    rate[i] = draws.uniform(0.8, 1.6);
    phase[i] = draws.uniform(0.0, 6.28);
  }
  const auto angle = [rate, phase](double t_s, std::size_t i, double amplitude) {
    return amplitude *
           (0.7 * std::sin(rate[i] * t_s + phase[i]) + 0.3 * std::sin(2.2 * rate[i + 1] * t_s + phase[i + 1]));
  };
  const bool is_rate = world.source == RotationSource::rate;
  scene.motion = [angle, is_rate](double t_s) {
    const Eigen::Vector3d angles(angle(t_s, 0, 14.0 * degree), angle(t_s, 2, 8.0 * degree), 0.0);
    return is_rate ? Eigen::Vector3d(1.5 * angles.y(), 1.5 * angles.x(), 0.0) : angles;
  };
  RotationLogConfig config;
  config.source = world.source;
  config.duration_s = 10.0;
  config.sigma_px = 0.3;
  config.clip_to_image = true;
  world.scene(scene, config, draws);
  RotationLog log = simulate_rotation(scene, config, seed);
  if (!world.gives_scale) log.sigma_scale = log.sigma_parallax = std::nullopt;
  add_faults(world.faults, image_width, image_height, seed, log);
  world.measured(log);
  return log;
}

ObserveSetup auto_config(ObserveMethod method = ObserveMethod::hybrid) {
  ObserveSetup config;
  config.method = method;
  config.estimate_auto =
      method == ObserveMethod::hybrid || method == ObserveMethod::batch || method == ObserveMethod::window;
  config.width_px = image_width;
  config.height_px = image_height;
  return config;
}

struct Outcome {
  int good = 0, bad = 0, silent = 0, beyond = 0, refused = 0, estimated = 0;
  double one = 0.0, two = 0.0;  ///< Share of values inside 1σ, 2σ. [%]
  std::vector<std::string> words;
};

/// `quantity`: one that is estimated once the cause is found.
Outcome outcome_of(const World& world, const ObserveSetup& config, const std::string& quantity = "",
                   int num_draws = sets) {
  Outcome outcome;
  double count = 0.0;
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(num_draws); ++seed) {
    const RotationLog log = log_in(world, seed);
    const ObserveSolution report = solve_intrinsics(log, config);
    const Verdict verdict = observe_verdict(report, log, config);
    outcome.words.push_back(verdict.sentence + " | " + verdict.to_add);
    if (report.status != ObserveSolution::Status::ok) {
      ++outcome.refused;
      continue;
    }
    double worst = 0.0;
    for (std::size_t i = 0; i < 4; ++i) {
      const double truth = log.truth.back()[i];
      const double z = std::abs(report.quantities[i].value - truth) / report.quantities[i].sigma;
      outcome.one += z < 1.0;
      outcome.two += z < 2.0;
      count += 1.0;
      worst = std::max(worst, z);
    }
    outcome.good += verdict.state == State::good;
    outcome.bad += verdict.state == State::bad;
    outcome.beyond += worst > 5.0 && verdict.state != State::bad;
    outcome.silent += verdict.state == State::good && worst > 5.0;
    for (const ObservedQuantity& each : report.quantities) outcome.estimated += each.name == quantity;
    if (std::getenv("ALIDADE_SHOW") != nullptr) {
      std::printf("%d %.1fσ %s | %s\n", static_cast<int>(seed), worst, verdict.sentence.c_str(),
                  verdict.to_add.c_str());
    }
  }
  outcome.one *= 100.0 / std::max(count, 1.0);
  outcome.two *= 100.0 / std::max(count, 1.0);
  if (std::getenv("ALIDADE_SHOW") != nullptr) {
    std::printf("== good %d silent %d beyond %d refused %d estimated %d, 1σ %.0f 2σ %.0f %%\n", outcome.good,
                outcome.silent, outcome.beyond, outcome.refused, outcome.estimated, outcome.one, outcome.two);
  }
  return outcome;
}

World with_faults(const RotationFaults& faults) {
  World world;
  world.faults = faults;
  return world;
}

World with_scene(const std::function<void(RotationScene&, RotationLogConfig&, Draws&)>& scene) {
  World world;
  world.scene = scene;
  return world;
}

void expect_estimated(const World& world, const std::string& quantity) {
  const Outcome outcome = outcome_of(world, auto_config(), quantity);
  EXPECT_EQ(outcome.silent, 0) << quantity;
  EXPECT_EQ(outcome.beyond, 0) << quantity;
  EXPECT_GE(outcome.estimated, nearly_all()) << quantity;
  EXPECT_GE(outcome.two, 95.0 - margin_of_two()) << quantity;
}

TEST(ObserveCauses, ScaleOfTheEncodersIsEstimated) {
  // A curve of the angles within a turn explains 14° of a scale as well: that is estimated, or the scale.
  const Outcome outcome = outcome_of(with_faults({.angle_scale = 1.01}), auto_config(), "scale_pan");
  EXPECT_EQ(outcome.silent, 0);
  EXPECT_EQ(outcome.beyond, 0);
  EXPECT_GE(outcome.estimated, sets / 2);
}

TEST(ObserveCauses, BacklashIsEstimated) {
  expect_estimated(with_faults({.backlash_rad = 0.1 * degree}), "backlash_pan_rad");
}

TEST(ObserveCauses, AxesThatAreNotPerpendicularAreEstimated) {
  for (const double skew_rad : {0.5 * degree, -0.2 * degree}) {
    expect_estimated(
        with_scene([=](RotationScene& scene, RotationLogConfig&, Draws&) { scene.axes_skew_rad = skew_rad; }),
        "axes_skew_rad");
  }
}

TEST(ObserveCauses, BiasOfAGyroscopeIsEstimated) {
  World world = with_scene([](RotationScene&, RotationLogConfig& config, Draws& draws) {
    config.rate_bias_rad_per_s = 0.005 * draws.normal3();
  });
  world.source = RotationSource::rate;
  expect_estimated(world, "bias_x_rad_per_s");
}

/// Whoever says that the scale is exact says nothing of what else is a scale: an encoder's curve over part of a turn, a
/// gyroscope that is not straight. It is counted as it ordinarily is, and where the residuals half ask for it.
TEST(ObserveCauses, WhatIsAScaleTooIsCountedBesideOneThatIsExact) {
  ObserveSetup exact = auto_config();
  exact.sigma_scale = exact.sigma_parallax = 0.0;
  const World curved = with_faults({.once_a_turn_rad = 0.2 * degree});
  World bent;
  bent.source = RotationSource::rate;
  bent.measured = [](RotationLog& log) {
    for (RotationRow& row : log.rows) row.rate_rad_per_s *= 1.002;
  };
  for (const World& world : {curved, bent}) EXPECT_EQ(outcome_of(world, exact).silent, 0);
}

/// A thousandth: 5 ms at either end of the log, which no delay undoes.
TEST(ObserveCauses, AClockAtAnotherRateIsEstimated) {
  for (const RotationSource source : {RotationSource::head, RotationSource::rate}) {
    World world = with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) { scene.clock_rate = 1e-3; });
    world.source = source;
    world.gives_scale = true;
    expect_estimated(world, "clock_rate");
  }
}

TEST(ObserveCauses, LineTimeOfARollingShutterIsEstimated) {
  expect_estimated(with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) { scene.shutter_s = 0.02; }),
                   "shutter_s");
}

TEST(ObserveCauses, LeverIsEstimatedWherePointsAreAtDifferentDistances) {
  expect_estimated(with_scene([](RotationScene& scene, RotationLogConfig&, Draws& draws) {
                     scene.lever_arm_m = {0.02, -0.01, 0.05};
                     for (std::size_t i = 0; i < scene.start_px.size(); ++i) {
                       scene.depth_m.push_back(draws.uniform(1.0, 3.0));
                     }
                   }),
                   "lever_z_m");
}

TEST(ObserveCauses, TheWholeLensMountAndDelayAtOnce) {
  const World world = with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) {
    scene.intrinsics = [](double) {
      return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], -0.25, 0.08, -0.01, 0.001, -0.001};
    };
    scene.mount_rad = {0.02, -0.02, 0.03};
    scene.delay_s = -0.03;
  });
  const Outcome outcome = outcome_of(world, auto_config(), "delay_s");
  EXPECT_EQ(outcome.silent, 0);
  EXPECT_GE(outcome.estimated, nearly_all());
}

/// 1 % a minute, estimated row by row: the first row's focal length is as right as the last one's.
TEST(ObserveCauses, ASlowDriftIsEstimatedRowByRow) {
  World world = with_scene([](RotationScene& scene, RotationLogConfig& config, Draws&) {
    config.duration_s = 60.0;
    config.rate_hz = 10.0;
    scene.intrinsics = [](double t_s) {
      const double growth = 1.0 + 0.01 * t_s / 60.0;
      return RotatingIntrinsics{true_k[0] * growth, true_k[1] * growth, true_k[2], true_k[3]};
    };
  });
  expect_estimated(world, "focal_drift_per_s");
  const RotationLog log = log_in(world, 1);
  const ObserveSolution report = solve_intrinsics(log, auto_config(ObserveMethod::batch));
  for (const std::size_t row : {std::size_t{0}, log.rows.size() / 2, log.rows.size() - 1}) {
    const IntrinsicsEstimate& step = report.steps[row];
    EXPECT_NEAR(step.fx, log.truth[row][0], 4.0 * step.sigma[0]) << row;
    EXPECT_LT(step.sigma[0], 0.5) << row;
  }
}

TEST(ObserveCauses, AZoomThatNeverRestsIsRefused) {
  World world = with_scene([](RotationScene& scene, RotationLogConfig&, Draws& draws) {
    const double phase = draws.uniform(0.0, 6.28);
    scene.intrinsics = [phase](double t_s) {
      const double zoom = 1.0 + 0.15 * std::sin(1.3 * t_s + phase);
      return RotatingIntrinsics{true_k[0] * zoom, true_k[1] * zoom, true_k[2], true_k[3]};
    };
  });
  const Outcome outcome = outcome_of(world, auto_config());
  EXPECT_EQ(outcome.silent, 0);
  EXPECT_EQ(outcome.refused + outcome.bad, sets) << outcome.refused << " refused";
}

/// σ and verdicts where noise lasts along the tracks, and nothing else is wrong.
TEST(ObserveCauses, NoiseThatLastsIsCountedAndNoCause) {
  for (const double lasts_s : {0.1, 0.3}) {
    World world = with_faults({.noise_px = 0.3, .noise_lasts_s = lasts_s});
    world.gives_scale = true;
    constexpr int num_draws = 20;  // for shares: three standard errors are 15.6 % and 7.2 %
    const Outcome outcome = outcome_of(world, auto_config(), "", num_draws);
    EXPECT_GE(outcome.good, 18) << lasts_s;
    EXPECT_GE(outcome.one, 68.0 - 15.6) << lasts_s;
    EXPECT_GE(outcome.two, 95.0 - 7.2) << lasts_s;
  }
}

/// Encoders' noise asks for a rotation that is noisy, not for a delay.
TEST(ObserveCauses, NoiseOfTheEncodersIsNamed) {
  World world =
      with_scene([](RotationScene&, RotationLogConfig& config, Draws&) { config.sigma_angle_rad = 0.1 * degree; });
  world.gives_scale = true;
  const Outcome outcome = outcome_of(world, auto_config(), "delay_s");
  EXPECT_EQ(outcome.silent, 0);
  EXPECT_EQ(outcome.estimated, 0);
  int named = 0;
  for (const std::string& words : outcome.words) named += words.find("--rotation noisy") != std::string::npos;
  EXPECT_GE(named, nearly_all());
}

/// A filter is never worse than all rows together.
TEST(ObserveCauses, HybridAgreesWithBatch) {
  const World bent = with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) {
    scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], -0.2}; };
  });
  const World late = with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) { scene.delay_s = -0.03; });
  for (const World& world : {bent, late, with_faults({.swapped_share = 0.1})}) {
    const Outcome outcome = outcome_of(world, auto_config());
    EXPECT_EQ(outcome.refused, 0);
    EXPECT_EQ(outcome.beyond, 0);
    EXPECT_GE(outcome.two, 95.0 - margin_of_two());
  }
}

TEST(ObserveCauses, AQuarterOfThePointsMoves) {
  const Outcome outcome = outcome_of(with_faults({.moving_share = 0.25}), auto_config());
  EXPECT_EQ(outcome.silent, 0);
  EXPECT_EQ(outcome.beyond, 0);
  EXPECT_LE(outcome.refused, 1);
}

/// Behind a lens with distortion, too: they are rejected whole, and leave σ as if they had not been seen.
TEST(ObserveCauses, PointsThatMoveCostNothing) {
  constexpr std::size_t num_points = 40, num_moving = 10;  // the first ones move
  World world = with_scene([](RotationScene& scene, RotationLogConfig& config, Draws&) {
    scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], -0.2}; };
    scene.start_px = draw_points(image_width, image_height, num_points, 301);
    config.duration_s = 5.0;
  });
  world.faults.moving_share = static_cast<double>(num_moving) / num_points;
  ObserveSetup config = auto_config(ObserveMethod::batch);
  config.estimate_auto = false;
  config.nuisances.k1 = true;
  const RotationLog log = log_in(world, 1);
  RotationLog without = log;
  for (RotationRow& row : without.rows) {
    std::fill_n(row.px.begin(), num_moving, Eigen::Vector2d::Constant(not_seen));
  }
  const ObserveSolution with_moving = solve_intrinsics(log, config), still = solve_intrinsics(without, config);
  ASSERT_EQ(with_moving.status, ObserveSolution::Status::ok);
  for (std::size_t i = 0; i < 5; ++i) {
    const ObservedQuantity &a = with_moving.quantities[i], &b = still.quantities[i];
    EXPECT_NEAR(a.value, b.value, b.sigma_model) << a.name;
    EXPECT_NEAR(a.sigma_model, b.sigma_model, 0.1 * b.sigma_model) << a.name;  // pixels rejected by chance
  }
}

/// One pixel in a hundred anywhere ruins a regression, and the adjustment of all rows says so.
TEST(ObserveCauses, WrongPixelsAreNotSilentInARegression) {
  for (const ObserveMethod method : {ObserveMethod::flow, ObserveMethod::fang2011}) {
    World world = with_faults({.wrong_share = 0.01});
    world.gives_scale = true;
    EXPECT_EQ(outcome_of(world, auto_config(method)).silent, 0);
  }
}

TEST(ObserveCauses, AMisreadHeadIsNamed) {
  const std::vector<std::pair<RotationFaults, const char*>> misread{
      {{.angle_scale = 0.5}, "half of what the head turns"},
      {{.angle_scale = 2.0}, "twice what the head turns"},
      {{.signs = {-1.0, 1.0}}, "pan"},
      {{.signs = {1.0, -1.0}}, "tilt"},
      {{.swaps_axes = true}, "exchanged"}};
  for (const auto& [faults, word] : misread) {
    const int draws = testing::trials(1);  // each is compared with all other readings: seconds
    const Outcome outcome = outcome_of(with_faults(faults), auto_config(), "", draws);
    EXPECT_EQ(outcome.good, 0) << word;
    int named = 0;
    for (const std::string& words : outcome.words) named += words.find(word) != std::string::npos;
    EXPECT_GE(named, draws - draws / 10) << word;
  }
}

/// Readings are tried without distortion and mounting: what a solution explains with them was not misread.
TEST(ObserveCauses, WhatASolutionExplainsBetterIsNotMisread) {
  const RotationLog log = log_in(with_faults({.angle_scale = 0.5}), 1);
  ObserveSetup config = auto_config(ObserveMethod::batch);
  config.estimate_auto = false;
  ObserveSolution report = solve_intrinsics(log, config);
  ASSERT_EQ(report.status, ObserveSolution::Status::ok);
  report.sigma_px = 10.0;
  EXPECT_NE(misread_rotation(log, config, report, {}).words, "");
  report.sigma_px = 0.3;  // the points' noise
  EXPECT_EQ(misread_rotation(log, config, report, {}).words, "");
}

/// A lens that is not modelled seems to zoom. Given that there is no zoom, all rows are one camera's.
TEST(ObserveCauses, GivenThatNothingZoomsThereIsNoZoom) {
  ObserveSetup config = auto_config();
  config.no_zoom = true;
  config.estimate_auto = false;
  const World bent = with_scene([](RotationScene& scene, RotationLogConfig&, Draws&) {
    scene.intrinsics = [](double) { return RotatingIntrinsics{true_k[0], true_k[1], true_k[2], true_k[3], -0.1}; };
  });
  for (std::uint64_t seed = 1; seed <= 5; ++seed) {
    const ObserveSolution report = solve_intrinsics(log_in(bent, seed), config);
    for (const ObserveNote& note : report.events) EXPECT_NE(note.event, ObserveEvent::zoom);
    EXPECT_EQ(report.status, ObserveSolution::Status::ok);
  }
}

}  // namespace causes_of_observe
}  // namespace alidade
