#include "alidade/localize/frames/still_frames.h"

#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "alidade/simulate/draws.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

constexpr int num_points = 6;
constexpr double sigma_px = 0.5;

struct Stand {
  int num_frames = 600;
  double sway_px = 0.0;   ///< Amplitude, along u.
  double lasting = 0.0;   ///< Correlation of a point's errors from frame to frame.
  double outliers = 0.0;  ///< Share of the observations.
};

Eigen::Vector2d true_px(int point) { return {100.0 + 80.0 * point, 300.0 - 30.0 * point}; }

KeptFrames seen_from(const Stand& stand, Draws& draws) {
  KeptFrames frames(100000);
  std::vector<Eigen::Vector2d> errors_px(num_points, Eigen::Vector2d::Zero());
  for (int k = 0; k < stand.num_frames; ++k) {
    ObservationFrame frame{k, k / 30.0, {}};
    const double moved_px = stand.sway_px * std::sin(2.0 * std::numbers::pi * 0.2 * frame.t_s);
    for (int i = 0; i < num_points; ++i) {
      Eigen::Vector2d& error_px = errors_px[static_cast<std::size_t>(i)];
      const Eigen::Vector2d noise_px = sigma_px * draws.normal2();
      error_px = k == 0 ? noise_px
                        : (stand.lasting * error_px + std::sqrt(1.0 - stand.lasting * stand.lasting) * noise_px).eval();
      Eigen::Vector2d px = true_px(i) + error_px + Eigen::Vector2d(moved_px, 0.0);
      if (stand.outliers > 0.0 && draws.uniform() < stand.outliers) px.x() += 30.0;
      frame.observations.push_back({i, px, 0.0});
    }
    frames.add(std::move(frame));
  }
  return frames;
}

std::optional<KeptFrames> averaged(const Stand& stand, Draws& draws) {
  std::vector<KnownPoint> known;
  for (int i = 0; i < num_points; ++i) known.push_back({i, Eigen::Vector3d::Zero(), 0.001});
  return averaged_still(seen_from(stand, draws), known, sigma_px);
}

TEST(StillFrames, NoiseIsNoMotion) {
  Draws draws(1);
  const int trials = testing::trials(200);
  int still = 0;
  for (int i = 0; i < trials; ++i) still += averaged({}, draws) ? 1 : 0;
  EXPECT_GE(still, trials - 3 - trials / 100);  // 3 σ to one side: 1 of 740
  Stand few;
  few.outliers = 0.02;
  EXPECT_TRUE(averaged(few, draws));
}

/// A sway of half of the noise is one, seen by the target's four points or more for 20 s.
TEST(StillFrames, AMotionIsNamed) {
  Draws draws(2);
  for (const double sway_px : {0.35, 1.0, 20.0})
    for (int i = 0; i < 20; ++i) EXPECT_FALSE(averaged({.sway_px = sway_px}, draws)) << sway_px;
  EXPECT_FALSE(averaged({.num_frames = 80}, draws)) << "too few to average";
}

/// Means are as sure as they say, those of errors that last from frame to frame as well.
TEST(StillFrames, MeansHaveTheirSigma) {
  Draws draws(3);
  for (const double lasting : {0.0, 0.9}) {
    double squares = 0.0, num = 0.0;
    for (int i = 0; i < 20; ++i) {
      const auto means = averaged({.lasting = lasting}, draws);
      ASSERT_TRUE(means || lasting > 0.0);  // such errors scatter by more, now and then
      if (!means) continue;
      EXPECT_EQ(means->stride(), 20U);
      EXPECT_EQ(means->frames().size(), 30U);
      for (const ObservationFrame& frame : means->frames())
        for (const FeatureObservation& each : frame.observations) {
          squares += (each.px - true_px(static_cast<int>(each.id))).squaredNorm() / (each.sigma_px * each.sigma_px);
          num += 2.0;
        }
    }
    ASSERT_GT(num, 3000.0) << lasting;
    EXPECT_LT(squares / num, 1.15) << lasting;
    EXPECT_GT(squares / num, 0.45) << lasting;  // what could move unseen is added
  }
}

}  // namespace
}  // namespace alidade
