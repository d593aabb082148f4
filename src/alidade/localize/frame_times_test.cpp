#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <optional>

#include "alidade/localize.h"
#include "alidade/localize/checks/judge.h"
#include "alidade/simulate/underwater.h"
#include "alidade/testing/imu_run.h"

// The σ of the frames' times.

namespace alidade {
namespace {

/// A camera that swings before a target of known points.
Localization localized(std::optional<double> sigma_times_s) {
  UnderwaterScene world;
  world.camera = underwater_camera();
  world.num_points = 60;
  world.num_frames = 60;
  world.dt_s = 1.0 / 20.0;
  const UnderwaterSequence sequence = simulate_underwater(world, 3);
  LocalizeConfig config;
  config.sigma_times_s = sigma_times_s;
  for (const UnderwaterPoint& point : sequence.points)
    if (point.is_known) config.target.points.push_back({point.id, point.given_in_world, 1e-3});
  std::vector<ObservationFrame> frames;
  for (const UnderwaterFrame& frame : sequence.frames) {
    ObservationFrame seen{static_cast<long>(frames.size()), frame.t_s, {}};
    for (const UnderwaterObservation& observation : frame.observations)
      seen.observations.push_back({observation.id, observation.px, 0.0});
    frames.push_back(std::move(seen));
  }
  return localize(frames, world.camera, config, {});
}

const Assumption* times_of(const Localization& result) {
  const auto found = std::ranges::find(result.assumed, "times (s)", &Assumption::name);
  return found == result.assumed.end() ? nullptr : &*found;
}

/// Late by σ, a pose is where its velocity takes it in that time.
TEST(FrameTimes, TheirSigmaCountsByTheVelocity) {
  constexpr double sigma_s = 0.02;
  const Localization none = localized({}), given = localized(sigma_s);
  ASSERT_EQ(none.path.size(), given.path.size());
  for (std::size_t k = 1; k + 1 < given.path.size(); ++k) {
    ASSERT_TRUE(given.path[k].has_pose());
    const Rigid3 &before = given.path[k - 1].world_from_cam, &after = given.path[k + 1].world_from_cam;
    const double speed_m_s =
        (after.translation - before.translation).norm() / (given.path[k + 1].t_s - given.path[k - 1].t_s);
    const double more_m2 = (given.path[k].cov - none.path[k].cov).topLeftCorner<3, 3>().trace();
    EXPECT_NEAR(std::sqrt(more_m2), sigma_s * speed_m_s, 1e-3 * sigma_s * speed_m_s + 1e-9) << k;
  }
  const Assumption *unknown = times_of(none), *counted = times_of(given);
  ASSERT_TRUE(unknown != nullptr && counted != nullptr);
  EXPECT_FALSE(unknown->sigma);
  EXPECT_EQ(counted->sigma, sigma_s);
  EXPECT_GT(sigma_s / unknown->ordinary * unknown->moves, 1.0);
  EXPECT_LE(counted->moves, 1.0);
}

TEST(FrameTimes, ThatAreExactChangeNothing) {
  const Localization none = localized({}), exact = localized(0.0);
  for (std::size_t k = 0; k < exact.path.size(); ++k) EXPECT_EQ(exact.path[k].cov, none.path[k].cov) << k;
  ASSERT_NE(times_of(exact), nullptr);
  EXPECT_EQ(times_of(exact)->sigma, 0.0);
}

/// An IMU has a clock of its own: where the two agree, the times are known as well as they do.
TEST(FrameTimes, AnImuShowsWhetherTheyAreRight) {
  for (const double late_s : {0.0, -0.02, 0.02}) {
    ImuScene scene;
    scene.late_s = late_s;
    const testing::ImuRun run = testing::swinging(3, scene);
    LocalizeConfig config = testing::with_imu(run);
    const Localization result = localize(run.frames, run.camera, config, run.truth);
    ASSERT_TRUE(result.imu);
    ASSERT_EQ(result.imu->fault, ImuFault::none) << result.verdict.sentence;
    const Assumption* times = times_of(result);
    ASSERT_NE(times, nullptr);
    EXPECT_EQ(times->sigma.has_value(), late_s == 0.0);
    EXPECT_LT(times->sigma.value_or(0.0), 0.001);
    const bool is_named = result.verdict.sentence.find("the IMU's clock is 0.0") != std::string::npos;
    EXPECT_EQ(is_named, late_s != 0.0) << result.verdict.sentence;
    EXPECT_EQ(result.verdict.state, late_s == 0.0 ? State::good : State::care) << result.verdict.sentence;
    if (late_s <= 0.0) continue;
    config.sigma_times_s = 0.0;
    EXPECT_EQ(localize(run.frames, run.camera, config, run.truth).verdict.state, State::good);
  }
}

TEST(FrameTimes, ARateOtherThanTheVideosOwnIsAssumed) {
  Localization result;
  for (int i = 0; i <= 10; ++i) {
    result.path.emplace_back();
    result.path.back().t_s = 0.02 * i;
  }
  add_rate_assumed(0.0, result);   // a folder
  add_rate_assumed(50.2, result);  // rounded
  EXPECT_TRUE(result.assumed.empty());
  add_rate_assumed(25.0, result);
  ASSERT_EQ(result.assumed.size(), 1u);
  EXPECT_EQ(result.assumed.front().name, "frames a second, not the video's own 25");
  EXPECT_NEAR(result.assumed.front().value, 50.0, 1e-9);
}

}  // namespace
}  // namespace alidade
