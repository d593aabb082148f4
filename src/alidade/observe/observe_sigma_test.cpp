#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <functional>

#include "alidade/geometry/degree.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/trials.h"

// Does σ hold, where the model is true and where errors are shared; and is a cause that nobody modelled ever silent?

namespace alidade {
namespace sigma_of_observe {

constexpr int width_px = 780, height_px = 582;
const Eigen::Vector4d truth(710.0, 700.0, 390.0, 290.0);

struct Scenario {
  int num_points = 6;
  double duration_s = 8.0, rate_hz = 20.0;
  RotationSource source = RotationSource::head;
  std::function<void(RotationScene&, Draws&)> scene = [](RotationScene&, Draws&) {};
  std::function<void(RotationLog&, Draws&)> disturb = [](RotationLog&, Draws&) {};
};

RotationLog log_of(const Scenario& scenario, std::uint64_t seed) {
  RotationScene scene;
  scene.start_px = draw_points(width_px, height_px, scenario.num_points, seed);
  if (scenario.source == RotationSource::rate) {
    scene.motion = paper_rate;
  } else {
    scene.motion = [](double t_s) { return Eigen::Vector3d(2.0 * paper_pan_tilt(t_s, 0.0)); };
  }
  Draws draws(1000 + seed);
  scenario.scene(scene, draws);
  RotationLogConfig config;
  config.source = scenario.source;
  config.rate_hz = scenario.rate_hz;
  config.duration_s = scenario.duration_s;
  RotationLog log = simulate_rotation(scene, config, seed);
  scenario.disturb(log, draws);
  return log;
}

ObserveSetup config_of(ObserveMethod method = ObserveMethod::hybrid) {
  ObserveSetup config;
  config.method = method;
  config.width_px = width_px;
  config.height_px = height_px;
  return config;
}

Eigen::Vector4d z_of(const ObserveSolution& report) {
  Eigen::Vector4d z;
  for (int i = 0; i < 4; ++i) {
    const ObservedQuantity& quantity = report.quantities[static_cast<std::size_t>(i)];
    z[i] = (quantity.value - truth[i]) / quantity.sigma;
  }
  return z;
}

struct Coverage {
  double one = 0.0, two = 0.0, good = 0.0, rms_over_bound = 0.0;
};

Coverage coverage_of(const Scenario& scenario, const ObserveSetup& config, int sets) {
  Coverage coverage;
  double count = 0.0, squares = 0.0;
  for (int set = 1; set <= sets; ++set) {
    const RotationLog log = log_of(scenario, static_cast<std::uint64_t>(set));
    const ObserveSolution report = solve_intrinsics(log, config);
    EXPECT_EQ(report.status, ObserveSolution::Status::ok) << set;
    if (report.status != ObserveSolution::Status::ok) continue;
    const Verdict verdict = observe_verdict(report, log, config);
    if (verdict.state != State::good && std::getenv("ALIDADE_SHOW")) {
      std::printf("%d %s | %s\n", set, verdict.sentence.c_str(), verdict.to_add.c_str());
    }
    coverage.good += verdict.state == State::good;
    const Eigen::Vector4d z = z_of(report);
    for (int i = 0; i < 4; ++i) {
      const ObservedQuantity& quantity = report.quantities[static_cast<std::size_t>(i)];
      coverage.one += std::abs(z[i]) < 1.0;
      coverage.two += std::abs(z[i]) < 2.0;
      squares += std::pow((quantity.value - truth[i]) / quantity.bound, 2);
      count += 1.0;
    }
  }
  coverage.one *= 100.0 / count;
  coverage.two *= 100.0 / count;
  coverage.good *= 100.0 / sets;
  coverage.rms_over_bound = std::sqrt(squares / count);
  if (std::getenv("ALIDADE_SHOW")) {
    std::printf("1σ %.1f %% 2σ %.1f %% good %.1f %% rms/bound %.3f\n", coverage.one, coverage.two, coverage.good,
                coverage.rms_over_bound);
  }
  return coverage;
}

/// 4 × 120 values: a standard error of 2.1 % at 1σ, 1 % at 2σ.
TEST(ObserveSigma, CoversWhereTheModelIsTrue) {
  for (const ObserveMethod method : {ObserveMethod::hybrid, ObserveMethod::batch}) {
    for (const RotationSource source : {RotationSource::head, RotationSource::rate}) {
      Scenario scenario;
      scenario.source = source;
      const Coverage coverage = coverage_of(scenario, config_of(method), 120);
      EXPECT_NEAR(coverage.one, 68.3, 4.0 + 2.1);
      EXPECT_NEAR(coverage.two, 95.4, 2.0 + 1.0);
      EXPECT_GE(coverage.good, 95.0);
      EXPECT_LE(coverage.rms_over_bound, 1.10);
    }
  }
}

/// Noise of each track that lasts for half a second.
void colour(RotationLog& log, Draws& draws) {
  const double keep = std::exp(-(log.rows[1].t_s - log.rows[0].t_s) / 0.5), sigma_px = 0.3;
  std::vector<Eigen::Vector2d> state(log.num_points, Eigen::Vector2d::Constant(not_seen));
  for (RotationRow& row : log.rows) {
    for (std::size_t i = 0; i < log.num_points; ++i) {
      const double x = draws.normal(), y = draws.normal();
      const Eigen::Vector2d fresh(sigma_px * x, sigma_px * y);
      state[i] = is_seen(state[i]) ? Eigen::Vector2d(keep * state[i] + std::sqrt(1.0 - keep * keep) * fresh) : fresh;
      row.px[i] += state[i];
    }
  }
}

/// Errors that last, and a bias of each point's track that changes with where it is seen.
TEST(ObserveSigma, CoversWhereErrorsAreSharedInTimeOrByTrack) {
  Scenario in_time, by_track;
  in_time.duration_s = 12.0;
  in_time.disturb = colour;
  by_track.disturb = [](RotationLog& log, Draws& draws) {
    for (std::size_t i = 0; i < log.num_points; ++i) {
      const double x = draws.normal(), y = draws.normal();
      for (RotationRow& row : log.rows) row.px[i] += 0.3 * Eigen::Vector2d(x, y);
    }
  };
  for (const Scenario& scenario : {in_time, by_track}) {
    const Coverage coverage = coverage_of(scenario, config_of(ObserveMethod::batch), 120);
    EXPECT_GE(coverage.two, 90.0 - 1.4);
    EXPECT_LE(coverage.two, 98.0 + 0.7);
  }
}

/// A patch that turns with the camera is compared with how it first looked: the error grows with the way from there,
/// for each point in another direction.
TEST(ObserveSigma, ATrackersErrorsAreNoCause) {
  Scenario scenario;
  scenario.num_points = 40;
  scenario.disturb = [](RotationLog& log, Draws& draws) {
    constexpr double px_per_px = 5e-4;
    for (std::size_t i = 0; i < log.num_points; ++i) {
      const Eigen::Vector2d first = log.rows.front().px[i];
      Eigen::Matrix2d drift;
      drift << draws.normal(), draws.normal(), draws.normal(), draws.normal();
      for (RotationRow& row : log.rows) row.px[i] += px_per_px * drift * (row.px[i] - first);
    }
  };
  int named = 0;
  const int sets = testing::trials(4);
  for (int set = 1; set <= sets; ++set) {
    const RotationLog log = log_of(scenario, static_cast<std::uint64_t>(set));
    const ObserveSetup config = config_of(ObserveMethod::batch);
    const ObserveSolution report = solve_intrinsics(log, config);
    ASSERT_EQ(report.status, ObserveSolution::Status::ok) << set;
    const Verdict verdict = observe_verdict(report, log, config);
    named += std::ranges::any_of(verdict.checks, [](const Check& check) { return check.name.starts_with("needs "); });
    EXPECT_LT(z_of(report).cwiseAbs().maxCoeff(), 5.0) << set;
    if (std::getenv("ALIDADE_SHOW")) std::printf("%d %s\n", set, verdict.sentence.c_str());
  }
  EXPECT_LE(named, sets / 10);
}

/// Half a second, though half of the noise does not last. One log says it to a third: 40 to 0.03 s; to 0.1 s with what
/// the fit takes of it.
TEST(ObserveSigma, FindsHowLongErrorsLast) {
  Scenario in_time;
  in_time.duration_s = 12.0;
  in_time.disturb = colour;
  double sum_s = 0.0;
  constexpr int sets = 40;
  for (std::uint64_t seed = 1; seed <= sets; ++seed) {
    sum_s += solve_intrinsics(log_of(in_time, seed), config_of(ObserveMethod::batch)).stated.correlation_s;
  }
  EXPECT_NEAR(sum_s / sets, 0.5, 0.1);
}

/// A cause, as the scene or the log has it, and how it may be called.
struct Cause {
  const char* name;
  std::function<void(RotationScene&, Draws&)> scene = [](RotationScene&, Draws&) {};
  std::function<void(RotationLog&, Draws&)> disturb = [](RotationLog&, Draws&) {};
};

void bend(RotationLog& log, double k2, double p1, double p2) {
  for (RotationRow& row : log.rows) {
    for (Eigen::Vector2d& px : row.px) {
      const double x = (px.x() - truth[2]) / truth[0], y = (px.y() - truth[3]) / truth[1], r2 = x * x + y * y;
      px += Eigen::Vector2d(truth[0] * (x * k2 * r2 * r2 + 2.0 * p1 * x * y + p2 * (r2 + 2.0 * x * x)),
                            truth[1] * (y * k2 * r2 * r2 + p1 * (r2 + 2.0 * y * y) + 2.0 * p2 * x * y));
    }
  }
}

void slacken(RotationLog& log, double backlash_rad) {
  for (int axis = 0; axis < 2; ++axis) {
    double output = log.rows.front().pan_tilt_roll_rad[axis];
    for (RotationRow& row : log.rows) {
      double& angle = row.pan_tilt_roll_rad[axis];
      // The camera lags behind: what is measured leads it by half of the play.
      const double lead = angle - output;
      if (std::abs(lead) > 0.5 * backlash_rad) output = angle - std::copysign(0.5 * backlash_rad, lead);
      angle += angle - output;  // measured so that the true angle is what it was
    }
  }
}

const std::vector<Cause>& causes() {
  static const auto angles = [](double (*of)(double)) {
    return [of](RotationLog& log, Draws&) {
      for (RotationRow& row : log.rows)
        for (int axis = 0; axis < 2; ++axis) row.pan_tilt_roll_rad[axis] = of(row.pan_tilt_roll_rad[axis]);
    };
  };
  static const std::vector<Cause> all{
      {.name = "k1",
       .scene =
           [](RotationScene& s, Draws&) {
             s.intrinsics = [](double) { return RotatingIntrinsics{710.0, 700.0, 390.0, 290.0, -0.1}; };
           }},
      {.name = "k2", .disturb = [](RotationLog& log, Draws&) { bend(log, 0.1, 0.0, 0.0); }},
      {.name = "p1,p2", .disturb = [](RotationLog& log, Draws&) { bend(log, 0.0, 0.004, -0.003); }},
      {.name = "mount",
       .scene =
           [](RotationScene& s, Draws&) {
             s.mount_rad = {0.02, -0.01, 0.03};
           }},
      {.name = "delay", .scene = [](RotationScene& s, Draws&) { s.delay_s = 0.03; }},
      {.name = "encoder scale", .disturb = angles([](double a) { return 1.01 * a; })},
      {.name = "error of the angles within a turn",
       .disturb = angles([](double a) { return a + 0.01 * std::cos(2.0 * a); })},
      {.name = "backlash", .disturb = [](RotationLog& log, Draws&) { slacken(log, 0.2 * degree); }},
      {.name = "zero that drifts",
       .disturb =
           [](RotationLog& log, Draws&) {
             for (RotationRow& row : log.rows) row.pan_tilt_roll_rad.head<2>().array() += 5e-4 * row.t_s;
           }},
      {.name = "lever",
       .scene =
           [](RotationScene& s, Draws& draws) {
             s.lever_arm_m = {0.0, 0.0, 0.05};
             for (std::size_t i = 0; i < s.start_px.size(); ++i) s.depth_m.push_back(draws.uniform(1.0, 3.0));
           }},
      {.name = "rolling shutter",
       .disturb =
           [](RotationLog& log, Draws&) {
             const RotationLog still = log;  // a row lower in the image is seen later, by up to 15 ms
             for (std::size_t k = 1; k + 1 < log.rows.size(); ++k) {
               const double span_s = still.rows[k + 1].t_s - still.rows[k - 1].t_s;
               for (std::size_t i = 0; i < log.num_points; ++i) {
                 const Eigen::Vector2d rate = (still.rows[k + 1].px[i] - still.rows[k - 1].px[i]) / span_s;
                 log.rows[k].px[i] += rate * 0.015 * (still.rows[k].px[i].y() / height_px);
               }
             }
           }},
      {.name = "focal length that drifts",
       .scene =
           [](RotationScene& s, Draws&) {
             s.intrinsics = [](double t_s) {
               return RotatingIntrinsics{710.0 * (1.0 + 1.7e-4 * t_s), 700.0 * (1.0 + 1.7e-4 * t_s), 390.0, 290.0, 0.0};
             };
           }},
  };
  return all;
}

/// Whatever is not as assumed: never ● with an error above 5σ, and mostly called by its name.
TEST(ObserveSigma, NoCauseIsSilent) {
  for (const Cause& cause : causes()) {
    int silent = 0, named = 0;
    const int sets = testing::trials(1);
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(sets); ++seed) {
      Scenario scenario;
      scenario.num_points = 10;
      scenario.scene = cause.scene;
      scenario.disturb = cause.disturb;
      RotationLog log = log_of(scenario, seed);
      log.sigma_scale = log.sigma_parallax = std::nullopt;  // nobody knows that anything is wrong, or exact
      const ObserveSetup config = config_of();
      const ObserveSolution report = solve_intrinsics(log, config);
      const Verdict verdict = observe_verdict(report, log, config);
      if (report.status != ObserveSolution::Status::ok) {
        ++named;
        continue;
      }
      const double worst = z_of(report).cwiseAbs().maxCoeff();
      silent += verdict.state == State::good && worst > 5.0;
      const auto check = std::find_if(verdict.checks.begin(), verdict.checks.end(),
                                      [](const Check& each) { return each.name.starts_with("needs "); });
      const bool is_named = check != verdict.checks.end() && check->name == std::string("needs ") + cause.name;
      named += is_named;
      if (std::getenv("ALIDADE_SHOW") && !is_named) {
        std::printf("%s %d: %.1fσ state %d, %s\n", cause.name, static_cast<int>(seed), worst,
                    static_cast<int>(verdict.state), check == verdict.checks.end() ? "-" : check->text.c_str());
      }
    }
    if (std::getenv("ALIDADE_SHOW")) std::printf("== %s: silent %d named %d of %d\n", cause.name, silent, named, sets);
    EXPECT_EQ(silent, 0) << cause.name;
  }
}

/// The same beside encoders' noise that is estimated with the rest, as the check *rotation's noise* advises.
TEST(ObserveSigma, NoCauseIsSilentBesideNoisyRotations) {
  constexpr double sigma_rad = 3e-4;
  ObserveSetup config = config_of();
  config.rotation = RotationKnowledge::noisy;
  config.sigma_angle_rad = sigma_rad;
  std::vector<Cause> with_none = causes();
  with_none.push_back({.name = "none"});
  const int sets = testing::trials(1);
  for (const Cause& cause : with_none) {
    int silent = 0, good = 0;
    for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(sets); ++seed) {
      Scenario scenario;
      scenario.num_points = 10;
      scenario.scene = cause.scene;
      scenario.disturb = [&](RotationLog& log, Draws& draws) {
        cause.disturb(log, draws);
        for (RotationRow& row : log.rows) row.pan_tilt_roll_rad.head<2>() += sigma_rad * draws.normal2();
      };
      RotationLog log = log_of(scenario, seed);
      if (std::string(cause.name) != "none") log.sigma_scale = log.sigma_parallax = std::nullopt;
      const ObserveSolution report = solve_intrinsics(log, config);
      const Verdict verdict = observe_verdict(report, log, config);
      if (report.status != ObserveSolution::Status::ok) continue;
      const double worst = z_of(report).cwiseAbs().maxCoeff();
      good += verdict.state == State::good;
      silent += verdict.state == State::good && worst > 5.0;
      if (std::getenv("ALIDADE_SHOW"))
        std::printf("%s %d: %.1fσ %s\n", cause.name, static_cast<int>(seed), worst, verdict.sentence.c_str());
    }
    EXPECT_EQ(silent, 0) << cause.name;
    if (std::string(cause.name) == "none") EXPECT_GE(good, sets - sets / 10);
  }
}

}  // namespace sigma_of_observe
}  // namespace alidade
