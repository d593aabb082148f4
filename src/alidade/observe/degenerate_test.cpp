#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"

namespace alidade {
namespace {

/// A degenerate log, and the words that must name why.
struct Degenerate {
  const char* name;
  const char* words;
  std::function<void(RotationScene&, RotationLogConfig&, std::uint64_t seed)> make;
};

Eigen::Vector3d only(const Eigen::Vector3d& axes, double t_s) { return axes.cwiseProduct(paper_rate(t_s)); }

const std::vector<Degenerate>& battery() {
  static const std::vector<Degenerate> all{
      {"pan", "pan only",
       [](RotationScene& s, RotationLogConfig&, std::uint64_t) {
         s.motion = [](double t) { return only({0, 1, 0}, t); };
       }},
      {"tilt", "tilt only",
       [](RotationScene& s, RotationLogConfig&, std::uint64_t) {
         s.motion = [](double t) { return only({1, 0, 0}, t); };
       }},
      {"roll", "roll only",
       [](RotationScene& s, RotationLogConfig&, std::uint64_t) {
         s.motion = [](double t) { return Eigen::Vector3d(0.0, 0.0, 0.2 * std::sin(1.6 * t)); };
       }},
      {"still", "does not turn",
       [](RotationScene& s, RotationLogConfig&, std::uint64_t) {
         s.motion = [](double) { return Eigen::Vector3d(0, 0, 0); };
       }},
      {"small span", "too small a span",
       [](RotationScene& s, RotationLogConfig& c, std::uint64_t) {
         s.motion = [](double t) { return Eigen::Vector3d(0.01 * paper_rate(t)); };
         c.sigma_px = 1.0;
       }},
      {"head, pan", "pan only",
       [](RotationScene& s, RotationLogConfig& c, std::uint64_t) {
         c.source = RotationSource::head;
         s.motion = [](double t) { return Eigen::Vector3d(paper_pan_tilt(t, 0.0).x(), 0.0, 0.0); };
       }},
      {"two rows", "too few points",
       [](RotationScene&, RotationLogConfig& c, std::uint64_t) { c.duration_s = 1.0 / 30.0; }},
  };
  return all;
}

RotationLog log_of(const Degenerate& one, std::uint64_t seed, int num_points = 4) {
  RotationScene scene;
  scene.motion = paper_rate;
  scene.start_px = draw_points(780, 582, num_points, seed);
  RotationLogConfig config;
  config.duration_s = 6.0;
  one.make(scene, config, seed);
  return simulate_rotation(scene, config, seed);
}

ObserveSetup config_of(ObserveMethod method) {
  ObserveSetup config;
  config.method = method;
  config.width_px = 780;
  config.height_px = 582;
  return config;
}

bool has_event(const ObserveSolution& report, ObserveEvent event) {
  return std::any_of(report.events.begin(), report.events.end(),
                     [&](const ObserveNote& note) { return note.event == event; });
}

TEST(ObserveDegenerate, EveryOneIsRefusedByNameWithEveryMethod) {
  int checked = 0;
  for (const Degenerate& one : battery()) {
    for (const ObserveMethod method : {ObserveMethod::hybrid, ObserveMethod::batch, ObserveMethod::window,
                                       ObserveMethod::flow, ObserveMethod::fang2011}) {
      for (std::uint64_t seed = 1; seed <= (method == ObserveMethod::window ? 1u : 4u); ++seed) {
        const RotationLog log = log_of(one, seed);
        const ObserveSetup config = config_of(method);
        const Verdict verdict = observe_verdict(solve_intrinsics(log, config), log, config);
        EXPECT_EQ(verdict.exit_code, ExitCode::undetermined)
            << one.name << ", method " << static_cast<int>(method) << ", seed " << seed << ": " << verdict.sentence;
        EXPECT_NE(verdict.sentence.find(one.words), std::string::npos)
            << one.name << ", method " << static_cast<int>(method) << ", seed " << seed << ": " << verdict.sentence;
        EXPECT_FALSE(verdict.to_add.empty());
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 7 * (4 * 4 + 1));
}

TEST(ObserveDegenerate, GoodLogsAreAcceptedEveryOne) {
  int accepted = 0;
  constexpr int sets = 100;
  for (std::uint64_t seed = 1; seed <= sets; ++seed) {
    const Degenerate none{"good", "", [](RotationScene&, RotationLogConfig&, std::uint64_t) {}};
    const RotationLog log = log_of(none, seed);
    const ObserveSetup config = config_of(ObserveMethod::hybrid);
    const Verdict verdict = observe_verdict(solve_intrinsics(log, config), log, config);
    accepted += verdict.exit_code == ExitCode::ok;
    EXPECT_EQ(verdict.exit_code, ExitCode::ok) << "seed " << seed << ": " << verdict.sentence;
  }
  EXPECT_EQ(accepted, sets);
}

TEST(ObserveDegenerate, ANarrowFieldNamesItsCentreAndDoesWithoutIt) {
  constexpr double f = 38462.0;  // 200 mm, 5.2 µm
  RotationScene scene;
  scene.width_px = 1024;
  scene.height_px = 1280;
  scene.intrinsics = [](double) { return RotatingIntrinsics{.fx = f, .fy = f, .cx = 511.5, .cy = 639.5}; };
  scene.motion = [](double t) { return Eigen::Vector3d(0.006 * std::sin(t), 0.006 * std::sin(1.7 * t), 0.0); };
  scene.start_px = draw_points(1024, 1280, 12, 1);
  const RotationLogConfig log_config{.source = RotationSource::head, .rate_hz = 5.0, .duration_s = 10.0};
  const RotationLog log = simulate_rotation(scene, log_config, 1);
  ObserveSetup config = config_of(ObserveMethod::batch);
  config.width_px = 1024;
  config.height_px = 1280;
  const Verdict refused = observe_verdict(solve_intrinsics(log, config), log, config);
  EXPECT_EQ(refused.exit_code, ExitCode::undetermined);
  EXPECT_NE(refused.sentence.find("too narrow"), std::string::npos) << refused.sentence;
  EXPECT_NE(refused.to_add.find("--fix-centre --square-pixels"), std::string::npos) << refused.to_add;

  config.fixed_centre = config.square_pixels = true;  // as it says
  const ObserveSolution solved = solve_intrinsics(log, config);
  EXPECT_EQ(observe_verdict(solved, log, config).exit_code, ExitCode::ok);
  EXPECT_NEAR(solved.quantities[0].value, f, 4.0 * solved.quantities[0].sigma);
  EXPECT_LT(solved.quantities[0].sigma, 0.002 * f);
}

TEST(ObserveDegenerate, ALineOfPointsIsNamedForThePapersObserverAndOthersTell) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    RotationScene scene;
    scene.motion = paper_rate;
    Draws draws(seed);
    const double slope = draws.uniform(-0.5, 0.5), v0 = draws.uniform(200.0, 380.0);
    for (int i = 0; i < 4; ++i) {
      const double u = 150.0 + 150.0 * i;
      scene.start_px.emplace_back(u, v0 + slope * (u - 375.0));
    }
    RotationLogConfig log_config;
    log_config.duration_s = 6.0;
    const RotationLog log = simulate_rotation(scene, log_config, seed);
    const ObserveSetup hybrid = config_of(ObserveMethod::hybrid);
    EXPECT_EQ(observe_verdict(solve_intrinsics(log, hybrid), log, hybrid).exit_code, ExitCode::ok) << "seed " << seed;
  }
}

/// What is not modelled is not taken for a zoom: the answer stands, and the verdict asks for the right thing.
TEST(ObserveDegenerate, DistortionOrAWrongMountIsNotTakenForAZoom) {
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    RotationScene scene;
    scene.motion = paper_rate;
    scene.start_px = draw_points(780, 582, 6, seed);
    RotationLogConfig log_config;
    log_config.duration_s = 6.0;
    if (seed % 2 == 0) {
      scene.intrinsics = [](double) { return RotatingIntrinsics{710.0, 700.0, 390.0, 290.0, -0.2}; };
    } else {
      scene.mount_rad = {0.03, -0.02, 0.04};
    }
    const RotationLog log = simulate_rotation(scene, log_config, seed);
    const ObserveSetup config = config_of(ObserveMethod::hybrid);
    const ObserveSolution report = solve_intrinsics(log, config);
    EXPECT_NE(report.status, ObserveSolution::Status::focal_length_varies) << "seed " << seed;
  }
}

/// Rows before a step of the zoom are of another focal length, and not outliers of all rows together.
TEST(ObserveDegenerate, AStepOfTheZoomIsFollowedAndTheAnswerIsGood) {
  constexpr int sets = 20;
  int good = 0;
  for (std::uint64_t seed = 1; seed <= sets; ++seed) {
    RotationScene scene;
    scene.motion = paper_rate;
    scene.intrinsics = [](double t_s) {
      const double zoom = t_s < 6.0 ? 1.0 : 1.1;
      return RotatingIntrinsics{.fx = 710.0 * zoom, .fy = 700.0 * zoom, .cx = 390.0, .cy = 290.0};
    };
    scene.start_px = draw_points(780, 582, 4, seed);
    const RotationLog log = simulate_rotation(scene, {}, seed);
    const ObserveSetup config = config_of(ObserveMethod::hybrid);
    const ObserveSolution report = solve_intrinsics(log, config);
    const Verdict verdict = observe_verdict(report, log, config);
    good += verdict.state == State::good;
    EXPECT_TRUE(has_event(report, ObserveEvent::zoom)) << "seed " << seed;
    EXPECT_NEAR(report.quantities[0].value, 781.0, 5.0 * report.quantities[0].sigma) << "seed " << seed;
    EXPECT_NE(verdict.state, State::bad) << "seed " << seed << ": " << verdict.to_add;
  }
  EXPECT_GE(good, sets - 1);
}

}  // namespace
}  // namespace alidade
