#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <functional>

#include "alidade/geometry/degree.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/solve/solve.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/trials.h"

// Logs in which the lens zooms twice, and something else happens as well.

namespace alidade {
namespace zooming_logs {

constexpr int width = 1280, height = 720;

struct Zooms {
  double focal_px = 0.0, begin_s[2] = {}, factor[2] = {}, sway = 0.0;
  [[nodiscard]] RotatingIntrinsics at(double t_s) const {
    double f = focal_px * (1.0 + sway * std::sin(2.0 * t_s));
    for (int i : {0, 1}) f *= std::pow(factor[i], std::clamp((t_s - begin_s[i]) / 1.5, 0.0, 1.0));
    return {f, f, 636.0, 363.0};
  }
};

Zooms draw_zooms(Draws& draws, double sway) {
  return {draws.uniform(800.0, 1100.0),
          {draws.uniform(5.0, 6.5), draws.uniform(10.0, 11.0)},
          {draws.uniform(1.2, 1.6), draws.uniform(0.7, 1.3)},
          sway};
}

RotationLog log_of(const Zooms& zooms, std::uint64_t seed) {
  Draws draws(seed);
  RotationScene scene;
  scene.width_px = width;
  scene.height_px = height;
  scene.start_px = draw_points(width, height, 60, seed);
  scene.intrinsics = [=](double t_s) { return zooms.at(t_s); };
  const double pan_rate = draws.uniform(0.8, 1.6), tilt_rate = draws.uniform(1.0, 1.8), phase = draws.uniform(0.0, 6.0);
  scene.motion = [=](double t_s) {
    return Eigen::Vector3d(9.0 * degree * std::sin(pan_rate * t_s + phase), 6.0 * degree * std::sin(tilt_rate * t_s),
                           0.0);
  };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.duration_s = 16.0;
  config.sigma_px = 0.4;
  config.clip_to_image = true;
  RotationLog log = simulate_rotation(scene, config, seed);
  log.sigma_scale = log.sigma_parallax = 0.0;
  return log;
}

/// What becomes of a ray (x, y, 1) at a time.
using RayChange = std::function<Eigen::Vector3d(double t_s, const Eigen::Vector3d& ray)>;

void change_rays(const RayChange& change, const Zooms& zooms, RotationLog& log) {
  for (RotationRow& row : log.rows) {
    const RotatingIntrinsics k = zooms.at(row.t_s);
    for (Eigen::Vector2d& px : row.px) {
      if (!is_seen(px)) continue;
      const Eigen::Vector3d ray = change(row.t_s, {(px.x() - k.cx) / k.fx, (px.y() - k.cy) / k.fy, 1.0});
      px = {k.fx * ray.x() / ray.z() + k.cx, k.fy * ray.y() / ray.z() + k.cy};
    }
  }
}

/// From then on every ray is rotated in the camera.
void bump(double from_s, const Eigen::Vector3d& rotation_rad, const Zooms& zooms, RotationLog& log) {
  const Eigen::Matrix3d rotation = exp_so3(rotation_rad).toRotationMatrix();
  change_rays([&](double t_s, const Eigen::Vector3d& ray) { return t_s < from_s ? ray : rotation * ray; }, zooms, log);
}

/// One pixel in 25 is anywhere.
void put_wrong_pixels(Draws& draws, RotationLog& log) {
  for (RotationRow& row : log.rows) {
    for (Eigen::Vector2d& px : row.px)
      if (is_seen(px) && draws.uniform(0.0, 1.0) < 0.04) px = {draws.uniform(0.0, width), draws.uniform(0.0, height)};
  }
}

ObserveSetup setup() {
  ObserveSetup config;
  config.estimate_auto = true;
  config.width_px = width;
  config.height_px = height;
  return config;
}

/// The largest error of each row over its σ, from 4 s on, where the row has an answer.
std::vector<double> row_errors(const ObserveSolution& report, const RotationLog& log, const Zooms& zooms) {
  std::vector<double> errors;
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const IntrinsicsEstimate& step = report.steps[k];
    if (!step.has_value || log.rows[k].t_s < 4.0) continue;
    const RotatingIntrinsics truth = zooms.at(log.rows[k].t_s);
    const Eigen::Vector4d difference = step.values() - Eigen::Vector4d(truth.fx, truth.fy, truth.cx, truth.cy);
    errors.push_back(difference.cwiseQuotient(step.sigma).cwiseAbs().maxCoeff());
  }
  return errors;
}

std::size_t num_beyond(const std::vector<double>& errors, double limit) {
  return static_cast<std::size_t>(std::ranges::count_if(errors, [=](double z) { return z > limit; }));
}

/// The first frame of a zoom fits neither the camera until then nor, for sure, another: its row had the old focal
/// length with the old σ, up to 400 σ off.
TEST(ZoomingLog, HasRowsWithinTheirSigma) {
  for (int seed = 1; seed <= testing::trials(1); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    const Zooms zooms = draw_zooms(draws, 0.0);
    const RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    const ObserveSolution report = solve_intrinsics(log, setup());
    EXPECT_EQ(observe_verdict(report, log, setup()).state, State::good) << seed;
    EXPECT_NE(std::ranges::find(report.assumed, "zoom.not_tested", &Assumption::name), report.assumed.end());
    const std::vector<double> errors = row_errors(report, log, zooms);
    ASSERT_GT(errors.size(), 250u);
    EXPECT_LE(num_beyond(errors, 5.0), errors.size() / 200) << seed;
    EXPECT_EQ(num_beyond(errors, 10.0), 0u) << seed;
  }
}

/// Wrong pixels in every frame, of one point in 25: a zoom's frames fitted no camera, nor did the rows before the zoom
/// fit the one after it, from which their adjustment began.
TEST(ZoomingLog, IsFollowedAmongWrongPixels) {
  for (int seed = 1; seed <= testing::trials(1); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    const Zooms zooms = draw_zooms(draws, 0.0);
    RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    put_wrong_pixels(draws, log);
    const ObserveSolution report = solve_intrinsics(log, setup());
    const Verdict verdict = observe_verdict(report, log, setup());
    EXPECT_EQ(verdict.state, State::good) << seed << ": " << verdict.to_add;
    const std::vector<double> errors = row_errors(report, log, zooms);
    ASSERT_GT(errors.size(), 250u);
    EXPECT_LE(num_beyond(errors, 5.0), errors.size() / 100) << seed;
  }
}

/// A zoom of 1 % is noticed late: its first frames were of the time that all rows are adjusted of, and the log was
/// called one whose focal length never rests.
TEST(ZoomingLog, OfAHundredthIsFollowed) {
  for (int seed = 1; seed <= testing::trials(1); ++seed) {
    Draws draws(40 + static_cast<std::uint64_t>(seed));
    Zooms zooms = draw_zooms(draws, 0.0);
    zooms.factor[0] = 1.01;
    zooms.factor[1] = 0.985;
    const RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    const ObserveSolution report = solve_intrinsics(log, setup());
    const Verdict verdict = observe_verdict(report, log, setup());
    EXPECT_EQ(verdict.state, State::good) << seed << ": " << verdict.to_add;
  }
}

/// A zoom of 0.4 % in 1.5 s is noticed after half a second: until then its frames moved the points and the centre,
/// which stayed up to 8 σ off to the end, silently, and its rows were up to 26 σ off.
TEST(ZoomingLog, OfAFewThousandthsLeavesNothingBehind) {
  for (int seed = 3; seed < 3 + testing::trials(1); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    Zooms zooms = draw_zooms(draws, 0.0);
    zooms.factor[1] = 0.996;
    RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    put_wrong_pixels(draws, log);
    const ObserveSolution report = solve_intrinsics(log, setup());
    EXPECT_EQ(observe_verdict(report, log, setup()).state, State::good) << seed;
    const std::vector<double> errors = row_errors(report, log, zooms);
    ASSERT_GT(errors.size(), 250u);
    EXPECT_LE(num_beyond(errors, 5.0), errors.size() / 100) << seed;
  }
}

/// A focal length that sways by 0.3 % all the time is an error that the pixels of a time share. The last row's σ had
/// it, the others' did not: most were beyond 5 σ.
TEST(ZoomingLog, HasRowsWithTheSharedErrorsOfTheLast) {
  for (int seed = 1; seed <= testing::trials(1); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    const Zooms zooms = draw_zooms(draws, 0.003);
    const RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    const ObserveSolution report = solve_intrinsics(log, setup());
    const State state = observe_verdict(report, log, setup()).state;
    EXPECT_NE(state, State::good) << seed;
    if (state != State::care) continue;
    const std::vector<double> errors = row_errors(report, log, zooms);
    EXPECT_LE(num_beyond(errors, 5.0), errors.size() / 20) << seed;
  }
}

/// A bump of 0.3° while the lens is at rest between zooms was followed as a zoom, with cx and cy up to 170 σ off.
TEST(ZoomingLog, SaysThatMoreThanTheLensHasChanged) {
  for (int seed = 1; seed <= testing::trials(2); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    const Zooms zooms = draw_zooms(draws, 0.0);
    RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    const Eigen::Vector3d axis(draws.normal(), draws.normal(), draws.normal());
    bump(draws.uniform(8.5, 14.5), 0.3 * degree * axis, zooms, log);
    const Verdict verdict = observe_verdict(solve_intrinsics(log, setup()), log, setup());
    EXPECT_NE(verdict.state, State::good) << seed;
  }
}

/// Distortion that grows with the zoom: the filter took it for the longest rest's at every zoom, up to 20 σ off, in two
/// of ten logs silently. Each rest has its own now.
TEST(ZoomingLog, HasTheDistortionOfEachZoom) {
  for (int seed = 1; seed <= testing::trials(2); ++seed) {
    Draws draws(static_cast<std::uint64_t>(seed));
    const Zooms zooms = draw_zooms(draws, 0.0);
    RotationLog log = log_of(zooms, static_cast<std::uint64_t>(seed));
    const double f0 = zooms.at(0.0).fx;
    const auto distort = [&](double t_s, const Eigen::Vector3d& ray) -> Eigen::Vector3d {
      const double k1 = -0.06 * (1.0 + 1.5 * std::log(zooms.at(t_s).fx / f0));
      const double radial = 1.0 + k1 * ray.head<2>().squaredNorm();
      return {radial * ray.x(), radial * ray.y(), 1.0};
    };
    change_rays(distort, zooms, log);
    const ObserveSolution report = solve_intrinsics(log, setup());
    EXPECT_NE(observe_verdict(report, log, setup()).state, State::good) << seed;
    const std::vector<double> errors = row_errors(report, log, zooms);
    ASSERT_GT(errors.size(), 250u);
    EXPECT_LT(errors.back(), 5.0) << seed;
    EXPECT_LE(num_beyond(errors, 5.0), errors.size() / 50) << seed;
  }
}

}  // namespace zooming_logs
}  // namespace alidade
