#include <gtest/gtest.h>

#include <cmath>

#include "alidade/testing/imu_run.h"
#include "alidade/testing/trials.h"

// An IMU whose biases drift, or whose clock runs fast.

namespace alidade {
namespace {

using testing::ImuRun;

/// 16 s, so that what drifts is seen.
ImuRun recorded(std::uint64_t seed) { return testing::swinging(seed, {}, 320, 1.0 / 20.0); }

struct Drifted {
  Localization result;
  double worst = 0.0;  ///< testing::worst_sigmas().
};

Drifted localized(const ImuRun& run) {
  Drifted drifted{localize(run.frames, run.camera, testing::with_imu(run), run.truth)};
  drifted.worst = testing::worst_sigmas(drifted.result, run);
  return drifted;
}

TEST(ImuDrift, OfAnImuAsItShouldBeNothingIsNamed) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const Drifted right = localized(recorded(seed));
    ASSERT_TRUE(right.result.imu);
    EXPECT_EQ(right.result.imu->fault, ImuFault::none) << right.result.verdict.sentence;
    EXPECT_EQ(right.result.imu->rate_walk_factor, 1.0) << seed;
    EXPECT_EQ(right.result.imu->force_walk_factor, 1.0) << seed;
    EXPECT_LT(std::abs(right.result.imu->clock_rate), 4.0 * right.result.imu->sigma_clock_rate) << seed;
    EXPECT_EQ(right.result.verdict.sentence.find("drifts"), std::string::npos) << right.result.verdict.sentence;
    EXPECT_EQ(right.result.verdict.sentence.find("clock runs"), std::string::npos) << right.result.verdict.sentence;
    EXPECT_LT(right.worst, 4.0) << seed;
  }
}

/// An accelerometer that warms up by 0.015 m/s³ bent paths by up to 8σ at ●.
TEST(ImuDrift, ABiasThatDriftsIsEstimatedAndNamed) {
  for (std::uint64_t seed = 1; seed <= static_cast<std::uint64_t>(testing::trials(2)); ++seed) {
    for (const bool is_of_rates : {false, true}) {
      ImuRun run = recorded(seed);
      for (ImuReading& each : run.imu.readings)
        (is_of_rates ? each.rate_rad_s : each.force_m_s2).x() += (is_of_rates ? 0.001 : 0.015) * each.t_s;
      const Drifted drifted = localized(run);
      ASSERT_TRUE(drifted.result.imu);
      ASSERT_EQ(drifted.result.imu->fault, ImuFault::none) << drifted.result.verdict.sentence;
      EXPECT_LT(drifted.worst, 4.5) << seed << is_of_rates;
      EXPECT_NE(drifted.result.verdict.sentence.find(is_of_rates ? "IMU's gyro drifts" : "IMU's accelerometer drifts"),
                std::string::npos)
          << drifted.result.verdict.sentence;
      const Eigen::Vector3d by = is_of_rates ? drifted.result.imu->rate_drift : drifted.result.imu->force_drift;
      EXPECT_NEAR(by.x() / ((is_of_rates ? 0.001 : 0.015) * 16.0), 1.0, 0.3) << seed << is_of_rates;
    }
  }
}

/// 0.3 % fast: 24 ms at either end of 16 s were another lens, other axes, and 8 to 25σ.
TEST(ImuDrift, AClockThatRunsFastIsFoundAndNamed) {
  for (const double rate : {-0.003, 0.001, 0.003}) {
    ImuRun run = recorded(5);
    for (ImuReading& each : run.imu.readings) each.t_s = (1.0 + rate) * each.t_s + 0.02;
    const Drifted fast = localized(run);
    ASSERT_TRUE(fast.result.imu);
    ASSERT_EQ(fast.result.imu->fault, ImuFault::none) << fast.result.verdict.sentence;
    EXPECT_NEAR(fast.result.imu->clock_rate, rate, 4.0 * fast.result.imu->sigma_clock_rate);
    EXPECT_LT(fast.result.imu->sigma_clock_rate, 3e-4);
    EXPECT_LT(fast.worst, 4.0) << rate;
    EXPECT_NE(fast.result.verdict.sentence.find("the IMU's clock runs"), std::string::npos)
        << fast.result.verdict.sentence;
    EXPECT_EQ(fast.result.verdict.sentence.find("lens"), std::string::npos) << fast.result.verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
