#include "alidade/track/checks/time_steps.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "alidade/simulate/draws.h"
#include "alidade/testing/track_sample.h"
#include "alidade/testing/trials.h"
#include "alidade/track/checks/track_assumed.h"

namespace alidade {
namespace {

std::vector<TargetObservation> at_times(const std::vector<double>& times_s) {
  std::vector<TargetObservation> observations;
  for (const double t_s : times_s) observations.push_back({.t_capture_s = t_s, .head = observations.size() % 2});
  return observations;
}

TEST(TimeSteps, AreTheLargestThatAllTimesAreApart) {
  Draws draws(1);
  std::vector<double> regular, rounded, frames, phases, irregular;
  for (int k = 0; k < 400; ++k) {
    const double t_s = 1.7e9 + 0.0333 * k + 0.005 * draws.normal();
    regular.push_back(0.013 + 0.05 * k);
    rounded.push_back(0.01 * std::round(t_s / 0.01));  // since 1970
    frames.push_back(1e-6 * std::round(1e6 * (k + (k > 200 ? 3 : 0)) / 30.0));
    phases.push_back(0.05 * k + (k % 2 == 0 ? 0.0 : 0.02));
    irregular.push_back(t_s);
  }
  EXPECT_NEAR(step_of_times(at_times(regular)), 0.05, 1e-6);
  EXPECT_NEAR(step_of_times(at_times(rounded)), 0.01, 1e-6);
  EXPECT_NEAR(step_of_times(at_times(frames)), 1.0 / 30.0, 1e-6);
  EXPECT_NEAR(step_of_times(at_times(phases)), 0.01, 1e-6);
  EXPECT_EQ(step_of_times(at_times(irregular)), 0.0);
  EXPECT_EQ(step_of_times(at_times({0.0, 0.05, 0.1})), 0.0);
}

/// Times rounded down to one, in steps.
std::vector<double> rounded_down(const std::vector<double>& times_in_steps) {
  std::vector<double> rounded;
  for (const double time : times_in_steps)
    if (rounded.empty() || std::floor(time) > rounded.back()) rounded.push_back(std::floor(time));
  return rounded;
}

/// Images every `interval` steps, each off by so much, of which a share is not there.
std::vector<double> images(double interval, double jitter = 0.0, double gone = 0.0) {
  Draws draws(7);
  std::vector<double> times;
  for (int k = 0; k < 300; ++k) {
    const double time = 0.3 + interval * k + jitter * draws.normal();
    if (draws.uniform(0.0, 1.0) >= gone) times.push_back(time);
  }
  return times;
}

TEST(TimeSteps, ThatImagesLieBetweenAreToldFromGaps) {
  for (const double interval : {3.3367, 4.1667, 1.6683, 1.43, 1.25, 1.05, 10.0 / 7.0, 4.016})  // 29.97 Hz, 10 ms; …
    EXPECT_TRUE(are_between_steps(rounded_down(images(interval)), 1.0)) << interval;
  EXPECT_TRUE(are_between_steps(rounded_down(images(3.3367, 0.0, 0.2)), 1.0));
  EXPECT_TRUE(are_between_steps(rounded_down(images(2.5, 0.4)), 1.0));
  for (const double interval : {1.0, 2.0, 5.0})
    for (const double gone : {0.0, 0.02, 0.1, 0.3, 0.6, 0.8, 0.9})
      EXPECT_FALSE(are_between_steps(rounded_down(images(interval, 0.0, gone)), 1.0)) << interval << " " << gone;
  std::vector<double> slower = rounded_down(images(4.0));  // 25 images a second, then 20
  for (int k = 0; k < 300; ++k) slower.push_back(slower.back() + 5.0);
  EXPECT_FALSE(are_between_steps(slower, 1.0));
  EXPECT_FALSE(are_between_steps(rounded_down({0.0, 1.5, 3.0, 4.5}), 1.0));
}

/// Scenario C by heads that take 20 images a second at phases of their own, whose times are rounded down.
struct Rounded {
  TrackScene scene = *track_scenario("C");
  std::vector<TargetObservation> observations;
  TrackReport report;
  FollowConfig config;

  Rounded(double phase_1_s, double phase_2_s, double step_s, std::uint64_t seed, double rate_hz = 20.0,
          double sigma_encoder_rad = 0.0) {
    scene.rate_hz = {rate_hz, rate_hz};
    if (sigma_encoder_rad > 0.0) {
      scene.sigma_encoder_rad = sigma_encoder_rad;
      for (RigHead& head : scene.heads) head.head.encoder.sigma_rad = sigma_encoder_rad;
    }
    scene.phase_s = {phase_1_s, phase_2_s};
    observations = testing::observations_of(scene, seed);
    for (TargetObservation& observation : observations) {
      if (step_s > 0.0) observation.t_capture_s = step_s * std::floor(observation.t_capture_s / step_s + 1e-9);
      observation.t_arrival_s = observation.t_capture_s;
    }
    report = track_target(observations, scene.heads, config);
  }
  /// By what σ would be without so much of the target's motion.
  [[nodiscard]] double worst_sigma(double counted_s = 0.0) const {
    double worst = 0.0;
    for (const TrackStep& step : report.steps)
      if (step.has_belief && step.t_s > 1.5)
        for (int k = 0; k < 3; ++k) {
          const double variance = step.belief.P(k, k) - std::pow(counted_s * step.belief.x[3 + k], 2);
          worst = std::max(worst, std::abs(step.belief.x[k] - scene.position(step.t_s)[k]) / std::sqrt(variance));
        }
    return worst;
  }
  [[nodiscard]] const Assumption* row(std::vector<Assumption>& assumed, double sigma_clock_s) const {
    Rig rig;
    rig.heads = scene.heads;
    assumed = track_assumed(observations, rig, config, report, {.sigma_clock_s = sigma_clock_s});
    const auto found = std::ranges::find(assumed, "times.not_tested", &Assumption::name);
    return found == assumed.end() ? nullptr : &*found;
  }
};

/// Both heads' times are 44 ms too early: good and far off, which no observations show. `assumed` says by how much.
TEST(TimeSteps, OfAllHeadsAreSaidToBeNotTested) {
  const Rounded rounded(0.0437, 0.0441, 0.05, 3);
  EXPECT_EQ(track_verdict(rounded.report, rounded.observations, rounded.scene.heads, rounded.config).state,
            State::good);
  EXPECT_GT(rounded.worst_sigma(), 5.0);
  std::vector<Assumption> assumed;
  const Assumption* row = rounded.row(assumed, 0.0);
  ASSERT_NE(row, nullptr);
  EXPECT_NEAR(row->value, 0.05, 1e-6);
  EXPECT_NE(row->moved.find("whole steps of 50 ms apart"), std::string::npos) << row->moved;
  // A target at v is step · v off: by the truth's own speed.
  std::vector<double> speeds;
  for (double t_s = 1.0; t_s < rounded.scene.duration_s - 0.1; t_s += 0.05)
    speeds.push_back((rounded.scene.position(t_s + 0.01) - rounded.scene.position(t_s)).norm() / 0.01);
  std::ranges::nth_element(speeds, speeds.begin() + static_cast<std::ptrdiff_t>(speeds.size() / 2));
  EXPECT_NEAR(move_within_step(rounded.observations, rounded.report)->moved_m, 0.05 * speeds[speeds.size() / 2],
              0.2 * 0.05 * speeds[speeds.size() / 2]);
  // It is no alarm: times of heads that a common trigger releases look the same.
  EXPECT_TRUE(row->sigma.has_value());
  EXPECT_TRUE(std::isnan(row->moves));
  const Rounded exact(0.0437, 0.0321371, 0.0, 3);
  std::vector<Assumption> none;
  EXPECT_EQ(exact.row(none, 0.0), nullptr);
  // Nor do observations show that all times are late alike.
  for (const std::vector<Assumption>& rows : {assumed, none}) {
    const auto late = std::ranges::find(rows, "times.late_alike", &Assumption::name);
    ASSERT_NE(late, rows.end());
    EXPECT_NE(late->moved.find("mm ("), std::string::npos) << late->moved;
    EXPECT_TRUE(std::isnan(late->moves));
  }
}

/// Images at 12 Hz lie between steps of 50 ms, of both heads alike: their times are 25 ms early on average.
TEST(TimeSteps, BetweenWhichImagesAreTakenAreNamedAndCounted) {
  for (int seed = 1; seed <= testing::trials(2); ++seed) {
    const Rounded rounded(0.013, 0.013, 0.05, static_cast<std::uint64_t>(seed), 12.0, 1e-4);
    const Verdict verdict = track_verdict(rounded.report, rounded.observations, rounded.scene.heads, rounded.config);
    ASSERT_TRUE(rounded.report.rounded.has_value()) << seed;
    EXPECT_NEAR(rounded.report.rounded->step_s, 0.05, 1e-6) << seed;
    EXPECT_EQ(verdict.state, State::care) << seed;
    EXPECT_NE(verdict.sentence.find("whole steps of 50 ms apart"), std::string::npos) << verdict.sentence;
    EXPECT_NE(verdict.to_add.find("--sigma-clock 0.029"), std::string::npos) << verdict.to_add;
    EXPECT_LT(rounded.worst_sigma(), 4.0) << seed;
    EXPECT_GT(rounded.worst_sigma(0.025), 5.0) << seed;
  }
}

/// Heads whose times are not rounded by the same: the cause of their clocks' difference is named.
TEST(TimeSteps, ThatShiftClocksAreTheCause) {
  int named = 0;
  const int draws = testing::trials(4);
  for (int seed = 1; seed <= draws; ++seed) {
    const Rounded rounded(0.0041, 0.0447, 0.05, static_cast<std::uint64_t>(seed));
    const Verdict verdict = track_verdict(rounded.report, rounded.observations, rounded.scene.heads, rounded.config);
    EXPECT_NE(verdict.state, State::good);
    const bool is_named = verdict.sentence.find("whole steps of 50 ms apart") != std::string::npos;
    named += is_named ? 1 : 0;
    if (is_named && verdict.state == State::care)
      EXPECT_NE(verdict.to_add.find("--sigma-clock 0.029"), std::string::npos) << verdict.to_add;
  }
  EXPECT_GE(named, (3 * draws + 3) / 4);
}

}  // namespace
}  // namespace alidade
