#include "alidade/servo/identify/frequent_commands.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/identify.h"
#include "alidade/testing/servo_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::error_in_sigma;
using testing::late_scene;
using testing::log_of;

ServoLogScene frequent_chirp(bool is_rate_plant, int commands_per_row, double rate_hz) {
  ServoLogScene scene = late_scene(is_rate_plant);
  scene.is_chirp = true;
  scene.duration_s = 20.0;
  scene.rate_hz = rate_hz;
  scene.commands_per_row = commands_per_row;
  scene.sigma_rad = 3e-4;
  scene.axis.command_delay_s = 0.075;  // a quarter of a row after one, where the ripple shows best
  return scene;
}

/// Held to the next row, a sine that is commanded more often is half a row late in the end: latencies 5 ms of 83 short
/// at 50 rows a second, 15 ms at 25, up to 118σ, at a good verdict.
TEST(FrequentCommands, MoreThanRowsAreLoggedAreFoundOrCounted) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  for (const bool is_rate_plant : {false, true}) {
    for (const auto& [per_row, rate_hz] : {std::pair{2, 50.0}, std::pair{4, 25.0}, std::pair{20, 50.0}}) {
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const ServoLogScene scene = frequent_chirp(is_rate_plant, per_row, rate_hz);
        const Identification found = identify(log_of(scene, seed));
        for (int param = 0; param < 3; ++param)
          EXPECT_LT(std::abs(error_in_sigma(found.fit, scene, param)), 3.0)
              << is_rate_plant << per_row << seed << param;
        EXPECT_LT(std::sqrt(found.fit.cov(ServoParam::latency, ServoParam::latency)), 0.4 / rate_hz);
        EXPECT_EQ(found.assumed[2].sigma, found.sigma_command_s);
        if (!is_rate_plant) EXPECT_GT(found.commands_per_row, 1u) << per_row << seed;
      }
    }
  }
}

/// Commands that change at rows alone: the ripple says so, and the verdict stays good.
TEST(FrequentCommands, AtRowsStayThere) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(2));
  for (const bool is_rate_plant : {false, true}) {
    for (const double rate_hz : {50.0, 100.0}) {
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const ServoLogScene scene = frequent_chirp(is_rate_plant, 1, rate_hz);
        const Identification found = identify(log_of(scene, seed));
        EXPECT_EQ(found.verdict.state, State::good) << found.verdict.sentence;
        EXPECT_EQ(found.commands_per_row, 0u);
        if (!is_rate_plant && rate_hz == 50.0) EXPECT_LT(found.sigma_command_s, 1e-4);
        EXPECT_LT(found.sigma_command_s, 0.5 / rate_hz);
        for (int param = 0; param < 3; ++param)
          EXPECT_LT(std::abs(error_in_sigma(found.fit, scene, param)), 4.0) << is_rate_plant << seed << param;
      }
    }
  }
}

/// Of a short latency what is open of it is said, and what would tell.
TEST(FrequentCommands, WhatTheyLeaveOfAShortLatencyIsNamed) {
  ServoLogScene scene = frequent_chirp(true, 1, 20.0);
  scene.axis.command_delay_s = 0.01;
  scene.high_hz = 0.5;  // slow: no ripple shows
  scene.sigma_rad = 9e-4;
  const std::vector<ServoSample> log = log_of(scene, 1);
  const Identification found = identify(log);
  EXPECT_EQ(found.verdict.state, State::care);
  EXPECT_NE(found.verdict.sentence.find("longer latency"), std::string::npos) << found.verdict.sentence;
  EXPECT_NE(found.verdict.to_add.find("command_t_s"), std::string::npos) << found.verdict.to_add;
  std::vector<ServoSample> timed = log;
  for (ServoSample& row : timed) row.command_t_s = row.t_s;
  EXPECT_EQ(identify(timed).verdict.state, State::good);
  EXPECT_FALSE(has_frequent_commands(log_of(late_scene(false), 1)));
}

}  // namespace
}  // namespace alidade
