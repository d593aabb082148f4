#include "alidade/servo/identify/log_times.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <variant>

#include "alidade/identify.h"
#include "alidade/servo/identify/identify_flaws.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/servo_sample.h"
#include "alidade/testing/trials.h"

namespace alidade {
namespace {

using testing::error_in_sigma;
using testing::late_scene;
using testing::log_of;

ServoLogScene scene_of(bool is_rate_plant, bool is_chirp) {
  ServoLogScene scene = late_scene(is_rate_plant, {0.3, AngleUnit::deg, 0.1});
  scene.is_chirp = is_chirp;
  return scene;
}

/// The log of an axis whose angles have other time stamps than its commands.
std::vector<ServoSample> with_clock(std::vector<ServoSample> log, double factor) {
  for (ServoSample& row : log) {
    row.command_t_s = row.t_s;
    row.t_s *= factor;
  }
  return log;
}

TEST(ServoLogTimes, AClockThatDriftsIsThatOfALogReadLater) {
  for (const bool is_rate_plant : {false, true}) {
    const std::vector<ServoSample> log = log_of(scene_of(is_rate_plant, true), 1);
    const ServoFit fit = identify_servo(log).fit;
    const Eigen::VectorXd exact = servo_response(with_clock(log, 1.002), fit.kind, fit.params).angle_rad;
    EXPECT_LT((flawed_response(log, fit, {.clock_rate = 0.002}) - exact).cwiseAbs().maxCoeff(), 1e-9);
  }
}

/// A drift of 0.1 % was a second lag, with a time constant 8σ and a latency 15σ off at a good verdict.
TEST(ServoLogTimes, AClockThatDriftsIsEstimated) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  double sum2 = 0.0;
  for (const bool is_rate_plant : {false, true}) {
    for (const bool is_chirp : {false, true}) {
      for (std::uint64_t seed = 1; seed <= draws; ++seed) {
        const ServoLogScene scene = scene_of(is_rate_plant, is_chirp);
        const ServoFit fit = identify_servo(with_clock(log_of(scene, seed), 1.001)).fit;
        ASSERT_EQ(std::ranges::count(fit.freed, ServoFlaw::clock_rate), 1) << is_rate_plant << is_chirp << seed;
        const double z = (fit.flaws.clock_rate - (1.0 / 1.001 - 1.0)) / fit.flaw_sigma[ServoFlaw::clock_rate];
        sum2 += z * z;
        for (int param = 0; param < 3; ++param) {
          sum2 += std::pow(error_in_sigma(fit, scene, param), 2);
          EXPECT_LT(std::abs(error_in_sigma(fit, scene, param)), 5.0) << is_rate_plant << is_chirp << seed << param;
        }
      }
    }
  }
  const double num = 16.0 * static_cast<double>(draws);
  EXPECT_LT(sum2 / num, 1.0 + 5.0 * std::sqrt(2.0 / num));
}

/// Of a log whose seconds are 0.1 % short nothing shows it: σ counts it, unless the clock is given as exact.
TEST(ServoLogTimes, TheClockOfTheLogIsCounted) {
  const ServoLogScene scene = scene_of(true, false);
  std::vector<ServoSample> log = log_of(scene, 1);
  for (ServoSample& row : log) row.t_s *= 1.001;
  const Identification counted = identify(log);
  EXPECT_EQ(counted.verdict.state, State::good);
  EXPECT_LT(std::abs(error_in_sigma(counted.fit, scene, ServoParam::gain)), 2.0);
  EXPECT_EQ(counted.assumed[1].moved, "gain_rad");
  const double gain = gain_of(scene.axis.plant), variance = counted.fit.cov(ServoParam::gain, ServoParam::gain);
  EXPECT_NEAR(counted.assumed[1].moved_by, 0.001 * gain, 1e-5 * gain);
  const Identification exact = identify(log, {.sigma_clock = 0.0});
  EXPECT_NEAR(variance - exact.fit.cov(ServoParam::gain, ServoParam::gain), std::pow(0.001 * gain, 2),
              0.01 * std::pow(0.001 * gain, 2));
  const double noise = std::sqrt(exact.fit.cov_model(ServoParam::gain, ServoParam::gain));
  EXPECT_GT(std::abs(exact.fit.params[ServoParam::gain] - gain), 5.0 * noise);  // beside what is counted otherwise
  EXPECT_THROW(static_cast<void>(identify(log, {.sigma_clock = -1.0})), ConfigError);
}

/// The angles of a log read up to so much later than their rows say.
std::vector<ServoSample> read_late(std::vector<ServoSample> log, const ServoLogScene& scene, double most_s,
                                   std::uint64_t seed) {
  const bool is_rate_plant = std::holds_alternative<RatePlant>(scene.axis.plant);
  ServoParams truth;
  truth << gain_of(scene.axis.plant), tau_of(scene.axis.plant), scene.axis.command_delay_s, 0.0, 0.0;
  const ServoKind kind = is_rate_plant ? ServoKind::rate : ServoKind::angle;
  std::vector<ServoSample> later = log;
  Draws draws(seed);
  for (ServoSample& row : later) {
    row.command_t_s = row.t_s;
    row.t_s += draws.uniform(0.0, most_s);
  }
  const Eigen::VectorXd added =
      servo_response(later, kind, truth).angle_rad - servo_response(log, kind, truth).angle_rad;
  for (std::size_t i = 0; i < log.size(); ++i) log[i].angle_rad += added[static_cast<Eigen::Index>(i)];
  return log;
}

/// Angles read 0 to 6 ms after their time stamps passed for a latency 10 to 20σ shorter.
TEST(ServoLogTimes, StampsThatErrAreCounted) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(2));
  std::uint64_t num_clean_seen = 0;
  for (const bool is_rate_plant : {false, true}) {
    const ServoLogScene scene = scene_of(is_rate_plant, true);
    for (std::uint64_t seed = 1; seed <= draws; ++seed) {
      const std::vector<ServoSample> log = log_of(scene, seed);
      num_clean_seen += identify_servo(log).sigma_time_s > 0.0 ? 1 : 0;
      const ServoIdentification identified = identify_servo(read_late(log, scene, 0.006, seed));
      EXPECT_NEAR(identified.sigma_time_s, 0.006 / std::sqrt(12.0), 4e-4) << is_rate_plant << seed;
      EXPECT_LT(std::abs(error_in_sigma(identified.fit, scene, ServoParam::latency)), 3.0) << is_rate_plant << seed;
    }
  }
  EXPECT_LE(num_clean_seen, 1 + draws / 25);
}

/// How the commands of a log lie to its rows.
enum class Commanded { at_rows, at_rows_that_are_lost, between_rows, at_rows_or_half_between };

/// The rows at 100 Hz of an axis that is simulated at 1000 Hz, commanded in steps of its own spacing. Of the rows
/// that are lost there are three in ten.
std::vector<ServoSample> commanded_log(ServoLogScene scene, Commanded how, std::uint64_t seed) {
  constexpr int per_row = 10;
  Draws draws(seed);
  const double rows_held = std::round(draws.uniform(30.0, 50.0));
  const bool is_half = how == Commanded::at_rows_or_half_between;
  scene.rate_hz = 1000.0;
  scene.duration_s = 5.0;
  scene.step_at_s = how == Commanded::between_rows ? 1e-3 * std::round(draws.uniform(480.0, 520.0)) : 0.5;
  // Of a spacing of whole rows commands would all lie alike, which no log shows.
  scene.hold_s = 1e-2 * (rows_held + (is_half ? 0.5 : how == Commanded::between_rows ? 0.3 : 0.0));
  std::vector<ServoSample> rows;
  const std::vector<ServoSample> log = log_of(scene, seed);
  for (std::size_t i = 0; i < log.size(); i += per_row)
    if (how != Commanded::at_rows_that_are_lost || i == 0 || draws.uniform(0.0, 1.0) > 0.3) rows.push_back(log[i]);
  return rows;
}

/// Limits, dead bands and clocks were estimated in place of such times, and latencies 8σ off. How commands lie between
/// rows is not known: a latency within a row.
TEST(ServoLogTimes, CommandsBeforeTheirRowsAreEstimated) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(1));
  int good = 0, runs = 0;
  double sum2 = 0.0;
  for (const Commanded how :
       {Commanded::at_rows_that_are_lost, Commanded::between_rows, Commanded::at_rows_or_half_between}) {
    for (const bool is_rate_plant : {false, true}) {
      for (std::uint64_t seed = 1; seed <= draws; ++seed, ++runs) {
        const ServoLogScene scene = late_scene(is_rate_plant);
        const Identification identified = identify(commanded_log(scene, how, seed));
        good += identified.verdict.state == State::good ? 1 : 0;
        EXPECT_TRUE(identified.fit.freed.empty()) << static_cast<int>(how) << is_rate_plant << seed;
        EXPECT_GT(identified.num_command_times, 0u) << static_cast<int>(how) << is_rate_plant << seed;
        for (int param = 0; param < 3; ++param) {
          const double z = error_in_sigma(identified.fit, scene, param);
          sum2 += z * z;
          EXPECT_LT(std::abs(z), 5.0) << static_cast<int>(how) << is_rate_plant << seed << param;
        }
        EXPECT_EQ(identified.assumed[2].sigma, identified.sigma_command_s);
      }
    }
  }
  EXPECT_GE(good, runs - (runs + 9) / 10) << "of " << runs;
  EXPECT_LT(sum2 / (3.0 * runs), 1.0 + 5.0 * std::sqrt(2.0 / (3.0 * runs)));
}

/// Each command a little further from its row than the one before: a drift of clocks, as far as the log goes, with a
/// latency a row short (118σ at a good verdict).
TEST(ServoLogTimes, CommandsThatDriftBetweenRowsAreNoClockForSure) {
  for (const bool is_rate_plant : {false, true}) {
    ServoLogScene scene = late_scene(is_rate_plant);
    scene.rate_hz = 1000.0;
    scene.duration_s = 9.0;
    scene.step_at_s = 0.491;
    scene.hold_s = 0.901;
    std::vector<ServoSample> rows;
    const std::vector<ServoSample> log = log_of(scene);
    for (std::size_t i = 0; i < log.size(); i += 10) rows.push_back(log[i]);
    const Identification identified = identify(rows);
    ASSERT_EQ(std::ranges::count(identified.fit.freed, ServoFlaw::clock_rate), 1);
    EXPECT_EQ(identified.verdict.state, State::care);
    EXPECT_NE(identified.verdict.sentence.find("between rows"), std::string::npos) << identified.verdict.sentence;
    for (int param = 0; param < 3; ++param) EXPECT_LT(std::abs(error_in_sigma(identified.fit, scene, param)), 3.0);
    // Clocks that drift by several rows are clocks.
    std::vector<ServoSample> drifted = log_of(late_scene(is_rate_plant));
    for (ServoSample& row : drifted) row.command_t_s = row.t_s, row.t_s *= 1.001;
    EXPECT_EQ(identify(drifted).sigma_command_s, 0.0);
  }
}

/// Commands at rows are not moved: the numbers are those of the plain model.
/// A limit just below what is commanded is no command between rows: a fit of it that stepped beyond the limit stayed
/// there, and the commands' times took it over (two of these ●, gain 14σ off).
TEST(ServoLogTimes, ALimitThatHardlyLimitsIsNoCommandBetweenRows) {
  for (const std::uint64_t seed : {9004u, 9006u, 9009u}) {
    ServoLogScene scene = scene_of(true, false);
    std::get<RatePlant>(scene.axis.plant).max_rate_rad_s = 1.04;  // 1.047 are commanded
    const ServoIdentification servo = identify_servo(log_of(scene, seed));
    EXPECT_EQ(servo.num_command_times, 0u) << seed;
    ASSERT_EQ(std::ranges::count(servo.fit.freed, ServoFlaw::rate_limit), 1) << seed;
    EXPECT_NEAR(servo.fit.flaws.max_rate_rad_s, 1.04, 5.0 * servo.fit.flaw_sigma[ServoFlaw::rate_limit]) << seed;
    EXPECT_LT(error_in_sigma(servo.fit, scene, ServoParam::gain), 5.0) << seed;
  }
}

TEST(ServoLogTimes, CommandsAtRowsStayThere) {
  const auto draws = static_cast<std::uint64_t>(testing::trials(2));
  for (const bool is_rate_plant : {false, true}) {
    for (std::uint64_t seed = 1; seed <= draws; ++seed) {
      const Identification identified = identify(commanded_log(late_scene(is_rate_plant), Commanded::at_rows, seed));
      EXPECT_EQ(identified.num_command_times, 0u) << is_rate_plant << seed;
      EXPECT_EQ(identified.sigma_command_s, 0.0);
    }
  }
}

/// Milliseconds from the middle of a log on: "no answer: the gain is not distinguishable from zero".
TEST(ServoLogTimes, TimesInTwoUnitsAreNamed) {
  std::vector<ServoSample> log = log_of(late_scene(false));
  for (std::size_t i = log.size() / 2; i < log.size(); ++i) log[i].t_s *= 1000.0;
  const Verdict verdict = identify(log).verdict;
  EXPECT_EQ(verdict.state, State::refused);
  EXPECT_NE(verdict.sentence.find("another unit"), std::string::npos) << verdict.sentence;
  std::vector<ServoSample> paused = log_of(late_scene(false));
  for (std::size_t i = paused.size() - 10; i < paused.size(); ++i) paused[i].t_s += 1000.0;
  EXPECT_EQ(identify(paused).verdict.sentence.find("another unit"), std::string::npos);
}

/// An encoder that begins again at half a turn: unwrapped, and said.
TEST(ServoLogTimes, AnEncoderThatBeginsAgainIsUnwrapped) {
  for (const bool is_rate_plant : {false, true}) {
    ServoLogScene scene = late_scene(is_rate_plant);
    std::vector<ServoSample> log = log_of(scene, 1);
    const ServoFit straight = identify(log).fit;
    for (ServoSample& row : log) row.angle_rad = std::remainder(row.angle_rad + 3.1, 2.0 * std::numbers::pi);
    const Identification found = identify(log);
    EXPECT_GT(found.encoder_wraps, 0u);
    EXPECT_EQ(found.verdict.state, State::good) << found.verdict.sentence;
    for (int param = 0; param < 3; ++param)
      EXPECT_NEAR(found.fit.params[param], straight.params[param], 0.01 * std::sqrt(straight.cov(param, param)));
  }
}

/// Regular rows, rounded to 10 ms: a resonance of 14 Hz, and a time constant 9σ off.
TEST(ServoLogTimes, RegularTimesAreThoseOfRegularRows) {
  for (const bool is_rate_plant : {false, true}) {
    ServoLogScene scene = late_scene(is_rate_plant);
    scene.rate_hz = 80.0;
    scene.duration_s = 10.0;
    scene.hold_s = 0.9125;
    std::vector<ServoSample> log = log_of(scene, 1);
    EXPECT_FALSE(regular_times(log));
    for (ServoSample& row : log) row.t_s = 0.01 * std::round(100.0 * row.t_s);
    const Identification found = identify(log);
    EXPECT_EQ(found.verdict.state, State::good) << found.verdict.sentence;
    EXPECT_TRUE(found.fit.freed.empty()) << found.verdict.sentence;
    EXPECT_EQ(std::ranges::count(found.verdict.checks, "times", &Check::name), 1);
    for (int param = 0; param < 3; ++param) EXPECT_LT(std::abs(error_in_sigma(found.fit, scene, param)), 4.0);
  }
}

}  // namespace
}  // namespace alidade
