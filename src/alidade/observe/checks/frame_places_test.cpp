#include "alidade/observe/checks/frame_places.h"

#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <cstddef>
#include <string>
#include <vector>

#include "alidade/geometry/degree.h"
#include "alidade/observe.h"
#include "alidade/observe/setup.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotation.h"
#include "alidade/testing/trials.h"

// Images that were dropped, or are there twice, beside the angles of a head.

namespace alidade {
namespace {

constexpr int width = 640, height = 480;
constexpr double true_f = 500.0;

/// Of one focal length.
RotationScene scene_of(int num_points, std::uint64_t seed) {
  RotationScene scene;
  scene.width_px = width;
  scene.height_px = height;
  scene.start_px = draw_points(width, height, num_points, seed);
  scene.intrinsics = [](double) { return RotatingIntrinsics{true_f, true_f, 320.0, 240.0}; };
  return scene;
}

/// Four seconds of a head that sways, 30 images a second.
RotationLog log_of(std::uint64_t seed, const RotationFaults& faults = {}, double delay_s = 0.0, double zoom = 1.0,
                   double rate_hz = 30.0) {
  Draws draws(9000 + seed);
  RotationScene scene = scene_of(40, 100 + seed);
  scene.intrinsics = [zoom](double t_s) {
    const double f = true_f * (t_s < 2.0 ? 1.0 : zoom);
    return RotatingIntrinsics{f, f, 320.0, 240.0};
  };
  scene.delay_s = delay_s;
  const double rate = draws.uniform(1.0, 1.6), other = draws.uniform(1.4, 2.4), phase = draws.uniform(0.0, 6.28);
  scene.motion = [=](double t_s) {
    return Eigen::Vector3d(14.0 * degree * std::sin(rate * t_s), 8.0 * degree * std::sin(other * t_s + phase), 0.0);
  };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.duration_s = 120.0 / rate_hz;
  config.rate_hz = rate_hz;
  config.sigma_px = rate_hz < 30.0 ? 0.05 : 0.3;  // as followed in a film, and as in a poor one
  config.clip_to_image = true;
  RotationLog log = simulate_rotation(scene, config, seed);
  log.sigma_parallax = 0.0;
  add_faults(faults, width, height, seed, log);
  return log;
}

/// Of images that are left from so many rows.
void drop(RotationLog& log, std::size_t before, std::size_t num) {
  for (std::size_t k = before; k + num < log.rows.size(); ++k) log.rows[k].px = log.rows[k + num].px;
  log.rows.resize(log.rows.size() - num);
  if (!log.truth.empty()) log.truth.resize(log.rows.size());
}

/// The image of a row once more behind it; those behind it a row later each, the last lost.
void insert(RotationLog& log, std::size_t row) {
  for (std::size_t k = log.rows.size() - 1; k > row; --k) log.rows[k].px = log.rows[k - 1].px;
}

ObserveReport observed(const RotationLog& log) {
  ObserveConfig config;
  config.width_px = width;
  config.height_px = height;
  return observe(log, config);
}

TEST(FramePlaces, MissingImagesAreNamedAndTheOthersPutInTheirRows) {
  for (std::uint64_t seed = 1; seed <= 2; ++seed) {
    RotationLog log = log_of(seed);
    drop(log, 70, 3);
    drop(log, 40, 1);
    const FramePlaces places = frame_places(log);
    ASSERT_EQ(places.missing.size(), 2u) << seed;
    EXPECT_EQ(places.missing[0].before, 40u);
    EXPECT_EQ(places.missing[0].num, 1);
    EXPECT_EQ(places.missing[1].before, 69u);
    EXPECT_EQ(places.missing[1].num, 3);
    EXPECT_TRUE(places.repeated.empty());
    const ObserveReport report = observed(log);
    EXPECT_EQ(report.verdict.state, State::care) << seed;
    EXPECT_NE(report.verdict.to_add.find("4 frames are missing"), std::string::npos) << report.verdict.to_add;
    EXPECT_NEAR(report.quantities[0].value, true_f, 5.0 * report.quantities[0].sigma) << seed;
    EXPECT_LT(report.quantities[0].sigma, 0.005 * true_f) << seed;
    for (const ObserveNote& note : report.events) EXPECT_NE(note.event, ObserveEvent::zoom) << seed;
  }
}

TEST(FramePlaces, ImagesThatAreThereTwiceAreLeftOut) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const RotationLog log = log_of(seed, {.repeated_every = 25});
    const FramePlaces places = frame_places(log);
    EXPECT_TRUE(places.missing.empty()) << seed;
    EXPECT_GE(places.repeated.size(), 3u) << seed;
    for (const std::size_t row : places.repeated) EXPECT_EQ(row % 25, 24u) << seed;
    const ObserveReport report = observed(log);
    EXPECT_EQ(report.verdict.state, State::care) << seed;
    EXPECT_NE(report.verdict.to_add.find("the one before once more"), std::string::npos) << report.verdict.to_add;
    EXPECT_NEAR(report.quantities[0].value, true_f, 5.0 * report.quantities[0].sigma) << seed;
  }
}

/// Pixels that are rounded stay where they are while a head hardly turns: nothing is there twice.
TEST(FramePlaces, RoundedPixelsOfASlowHeadAreNotThereTwice) {
  constexpr double step_px = 0.1;
  RotationScene scene = scene_of(12, 2);
  scene.motion = [](double t_s) { return paper_pan_tilt(t_s, 0.0); };
  RotationLogConfig config;
  config.source = RotationSource::head;
  config.rate_hz = 200.0;
  config.duration_s = 20.0;
  config.sigma_px = 0.0;
  RotationLog log = simulate_rotation(scene, config, 2);
  for (RotationRow& row : log.rows)
    for (Eigen::Vector2d& px : row.px)
      if (is_seen(px)) px = (px / step_px).array().round() * step_px;
  EXPECT_TRUE(frame_places(log).are_as_given());
}

/// As of a film that was given a constant rate: those behind are not in the rows of their time.
TEST(FramePlaces, ImagesBehindOnesThatWereInsertedArePutInTheirRows) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    RotationLog log = log_of(seed);
    const std::vector<std::size_t> rows{25, 50, 62, 90};
    for (std::size_t i = rows.size(); i > 0; --i) insert(log, rows[i - 1] - i);
    const FramePlaces places = frame_places(log);
    EXPECT_TRUE(places.missing.empty()) << seed;
    EXPECT_EQ(places.repeated.size(), rows.size()) << seed;
    const ObserveReport report = observed(log);
    EXPECT_EQ(report.verdict.state, State::care) << seed << report.verdict.sentence;
    EXPECT_NE(report.verdict.to_add.find("behind 4 of them"), std::string::npos) << report.verdict.to_add;
    ASSERT_FALSE(report.quantities.empty()) << seed;
    for (std::size_t i = 0; i < 4; ++i) {
      const double truth = std::array{true_f, true_f, 320.0, 240.0}[i];
      EXPECT_NEAR(report.quantities[i].value, truth, 5.0 * report.quantities[i].sigma) << seed << " " << i;
    }
    EXPECT_LT(report.quantities[0].sigma, 0.005 * true_f) << seed;
  }
}

/// Single ones, that move the image little where the head turns back, and in a film of few images a second.
TEST(FramePlaces, ManyMissingImagesAreFoundTogether) {
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    RotationLog log = log_of(seed, {}, 0.02, 1.0, 12.0);
    for (const std::size_t row : {90U, 72U, 55U, 37U, 22U}) drop(log, row, 1);
    int num = 0;
    for (const FramePlaces::Gap& gap : frame_places(log).missing) num += gap.num;
    EXPECT_EQ(num, 5) << seed;
  }
}

/// The images' clock is slow: they are in rows ever later, as if some were missing.
TEST(FramePlaces, ASlowClockIsNamedAsThat) {
  RotationScene scene = scene_of(12, 2);
  scene.clock_rate = 0.003;
  scene.motion = [](double t_s) {
    return Eigen::Vector3d(14.0 * degree * std::sin(1.3 * t_s), 8.0 * degree * std::sin(1.9 * t_s + 1.0), 0.0);
  };
  RotationLogConfig log_config;
  log_config.source = RotationSource::head;
  log_config.rate_hz = 30.0;
  log_config.duration_s = 66.0;
  log_config.sigma_px = 0.1;
  const RotationLog log = simulate_rotation(scene, log_config, 3);
  const ObserveReport report = observed(log);
  ASSERT_FALSE(report.quantities.empty()) << report.verdict.sentence;
  EXPECT_NEAR(report.quantities[0].value, true_f, 5.0 * report.quantities[0].sigma);
  EXPECT_NE(report.verdict.to_add.find("clock"), std::string::npos) << report.verdict.to_add;
  ObserveConfig config;
  config.width_px = width;
  config.height_px = height;
  config.estimate = {"clock"};
  for (const Check& check : observe(log, config).verdict.checks) EXPECT_NE(check.name, "frames") << check.text;
}

/// A delay, play in the gears, or a zoom moves many steps a little, or the image otherwise.
TEST(FramePlaces, NothingIsMissingOfOtherCauses) {
  const auto num_seeds = static_cast<std::uint64_t>(testing::trials(10));
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    EXPECT_TRUE(frame_places(log_of(seed)).are_as_given()) << seed;
    EXPECT_TRUE(frame_places(log_of(seed, {}, 0.05)).are_as_given()) << seed;
    EXPECT_TRUE(frame_places(log_of(seed, {}, -0.05)).are_as_given()) << seed;
    EXPECT_TRUE(frame_places(log_of(seed, {.backlash_rad = 0.3 * degree})).are_as_given()) << seed;
    EXPECT_TRUE(frame_places(log_of(seed, {.wrong_share = 0.1})).are_as_given()) << seed;
    EXPECT_TRUE(frame_places(log_of(seed, {}, 0.0, 1.3)).are_as_given()) << seed;
  }
}

}  // namespace
}  // namespace alidade
