#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <variant>

#include "alidade/geometry/degree.h"
#include "alidade/identify.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/servo/identify/sampled_log.h"
#include "alidade/testing/servo_sample.h"
#include "alidade/testing/trials.h"

// Commands that were not followed, and an encoder whose zero slips: what a log has that is none of the axis' doing.

namespace alidade {
namespace {

using testing::error_in_sigma;
using testing::late_scene;
using testing::log_of;

/// Steps of several sizes; where the axis is not to follow one, it goes by what it was last commanded.
std::vector<ServoSample> log_with_lost(const ServoLogScene& scene, std::uint64_t seed,
                                       const std::vector<std::size_t>& lost) {
  constexpr std::array<double, 12> commands{0, 90, -60, 150, 40, -120, 70, -30, 110, -150, 20, -80};
  constexpr std::size_t rows_each = 60;
  std::vector<ServoSample> given, followed;
  for (std::size_t i = 0; i < rows_each * commands.size(); ++i)
    given.push_back({0.01 * static_cast<double>(i), commands[i / rows_each], 0.0});
  followed = given;
  double last = 0.0;
  for (std::size_t i = 0; i < followed.size(); ++i) {
    if (i % rows_each == 0 && std::ranges::count(lost, i / rows_each) == 0) last = given[i].command;
    followed[i].command = last;
  }
  ServoFit truth;
  truth.kind = std::holds_alternative<RatePlant>(scene.axis.plant) ? ServoKind::rate : ServoKind::angle;
  truth.params << gain_of(scene.axis.plant), tau_of(scene.axis.plant), scene.axis.command_delay_s, 0.2, 0.0;
  const Eigen::VectorXd angles = servo_response(followed, truth.kind, truth.params).angle_rad;
  const std::vector<ServoSample> noise = log_of(late_scene(false), seed),
                                 other = log_of(late_scene(false), seed + 1000);
  for (std::size_t i = 0; i < given.size(); ++i) {
    // White noise of √2 σ: what two runs of one scene differ by.
    const double by = noise[i % noise.size()].angle_rad - other[i % noise.size()].angle_rad;
    given[i].angle_rad = angles[static_cast<Eigen::Index>(i)] + by;
  }
  return given;
}

/// One or three commands that never arrived were backlash of 2.6 rad, a limit of acceleration, or "too short or too
/// coarse".
TEST(LogFaults, CommandsThatWereNotFollowedAreNamed) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  const std::array<std::vector<std::size_t>, 3> cases{{{3}, {2, 5, 9}, {6, 7}}};
  for (const bool is_rate_plant : {false, true}) {
    const ServoLogScene scene = late_scene(is_rate_plant);
    for (const std::vector<std::size_t>& lost : cases) {
      std::vector<std::size_t> rows;
      for (const std::size_t each : lost) rows.push_back(60 * each);
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const std::vector<ServoSample> log = log_with_lost(scene, seed, lost);
        const ServoIdentification identified = identify_servo(log);
        EXPECT_EQ(identified.lost_commands, rows) << is_rate_plant << seed;
        EXPECT_TRUE(identified.slips.empty()) << is_rate_plant << seed;
        for (int param = 0; param < 3; ++param)
          EXPECT_LT(std::abs(error_in_sigma(identified.fit, scene, param)), 4.5) << is_rate_plant << seed << param;
        const Verdict verdict = identify_verdict(log, identified);
        EXPECT_EQ(verdict.state, State::care);
        EXPECT_NE(verdict.sentence.find("of 11 commands were not followed"), std::string::npos) << verdict.sentence;
      }
    }
  }
}

/// A slip of 0.3° was a limit of rate, or a gain that drifts or differs by the command's sign.
TEST(LogFaults, ASlipOfTheEncoderIsEstimated) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  double sum2 = 0.0;
  int runs = 0;
  for (const bool is_rate_plant : {false, true}) {
    for (const bool is_chirp : {false, true}) {
      for (std::uint64_t seed = 1; seed <= draws; ++seed, ++runs) {
        ServoLogScene scene = late_scene(is_rate_plant);
        scene.is_chirp = is_chirp;
        std::vector<ServoSample> log = log_of(scene, seed);
        const std::size_t from = log.size() / 2 + 7 * seed;
        for (std::size_t i = from; i < log.size(); ++i) log[i].angle_rad += 0.3 * degree;
        const ServoIdentification identified = identify_servo(log);
        ASSERT_EQ(identified.slips.size(), 1u) << is_rate_plant << is_chirp << seed;
        const ZeroSlip& slip = identified.slips.front();
        EXPECT_NEAR(static_cast<double>(slip.row), static_cast<double>(from), 2.0);
        EXPECT_TRUE(identified.lost_commands.empty());
        const double error = (slip.size_rad - 0.3 * degree) / slip.sigma_rad;
        EXPECT_LT(std::abs(error), 4.5) << is_rate_plant << is_chirp << seed;
        sum2 += error * error;
        for (int param = 0; param < 3; ++param)
          EXPECT_LT(std::abs(error_in_sigma(identified.fit, scene, param)), 4.5) << is_rate_plant << is_chirp << seed;
        const Verdict verdict = identify_verdict(log, identified);
        EXPECT_EQ(verdict.state, State::care);
        EXPECT_NE(verdict.sentence.find("slips by"), std::string::npos) << verdict.sentence;
      }
    }
  }
  EXPECT_LT(sum2 / runs, 1.0 + 5.0 * std::sqrt(2.0 / runs));
}

TEST(LogFaults, CleanLogsHaveNone) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(2));
  for (const bool is_rate_plant : {false, true}) {
    for (std::uint64_t seed = 1; seed <= draws; ++seed) {
      const std::vector<ServoSample> clean = log_with_lost(late_scene(is_rate_plant), seed, {});
      EXPECT_TRUE(lost_commands(clean, is_rate_plant ? ServoKind::rate : ServoKind::angle).empty()) << seed;
      const ServoIdentification identified = identify_servo(clean);
      EXPECT_TRUE(identified.slips.empty() && identified.lost_commands.empty()) << is_rate_plant << seed;
    }
  }
}

/// One angle of 3 rad in the first rows was the end of a log: "the gain is not distinguishable from zero".
TEST(LogFaults, SpikesAreLeftOut) {
  for (const bool is_rate_plant : {false, true}) {
    const ServoLogScene scene = late_scene(is_rate_plant);
    const std::vector<ServoSample> clean = log_of(scene, 1);
    EXPECT_TRUE(spikes(clean).empty());
    for (const auto& rows : std::vector<std::vector<std::size_t>>{{2}, {0}, {70, 71, 300}}) {
      std::vector<ServoSample> log = clean;
      for (const std::size_t row : rows) log[row].angle_rad += 3.0;
      EXPECT_EQ(spikes(log), rows);
      const Identification found = identify(log);
      EXPECT_EQ(found.verdict.state, State::good) << found.verdict.sentence;
      EXPECT_EQ(found.counts.given, found.counts.used + rows.size());
      for (int param = 0; param < 3; ++param)
        EXPECT_LT(std::abs(error_in_sigma(found.fit, scene, param)), 4.0) << is_rate_plant << rows.front();
    }
  }
}

}  // namespace
}  // namespace alidade
