#include "alidade/heads/streams/arrival_times.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/simulate/draws.h"

// Truth: frames are taken evenly, and a network holds each back for a while.

namespace alidade {
namespace {

constexpr double period_s = 1.0 / 12.0;

struct Errors {
  double rms_s = 0.0, mean_sigma_s = 0.0, raw_rms_s = 0.0;
};

/// Of frames 120 … 599, less what all of them are late alike.
Errors errors_of(std::uint64_t seed, double mean_delay_s, bool has_tick) {
  Draws draws(seed);
  ArrivalTimes filter;
  std::vector<double> off, raw;
  double last_came_s = 0.0, sigma_s = 0.0;
  for (int i = 0; i < 600; ++i) {
    const double taken_s = 1.7e9 + period_s * i;
    const double came_s = std::max(last_came_s, taken_s + 0.01 - mean_delay_s * std::log(1.0 - draws.uniform()));
    last_came_s = came_s;  // the order is kept
    const FilteredTime given = filter.add(came_s, has_tick ? std::optional(3.0 + period_s * i) : std::nullopt);
    EXPECT_LE(given.t_s, came_s);
    if (i < 120) continue;
    off.push_back(given.t_s - taken_s);
    raw.push_back(came_s - taken_s);
    sigma_s += given.sigma_s / 480.0;
  }
  const auto scatter = [](const std::vector<double>& values, double level) {
    double sum2 = 0.0;
    for (const double value : values) sum2 += (value - level) * (value - level);
    return std::sqrt(sum2 / static_cast<double>(values.size()));
  };
  double raw_mean = 0.0;
  for (const double value : raw) raw_mean += value / static_cast<double>(raw.size());
  return {scatter(off, 0.01), sigma_s, scatter(raw, raw_mean)};
}

TEST(ArrivalTimes, AreThoseOfTheFastestWithTheirSigma) {
  for (const double mean_s : {0.005, 0.02, 0.05}) {
    double rms2 = 0.0, sigma2 = 0.0, raw2 = 0.0;
    constexpr int runs = 20;
    for (std::uint64_t seed = 1; seed <= runs; ++seed) {
      const Errors errors = errors_of(seed, mean_s, seed % 2 == 0);
      rms2 += errors.rms_s * errors.rms_s / runs;
      sigma2 += errors.mean_sigma_s * errors.mean_sigma_s / runs;
      raw2 += errors.raw_rms_s * errors.raw_rms_s / runs;
    }
    EXPECT_LT(std::sqrt(rms2), 0.12 * std::sqrt(raw2)) << mean_s;
    EXPECT_LT(std::sqrt(rms2), 1.6 * std::sqrt(sigma2)) << mean_s;
    EXPECT_GT(std::sqrt(rms2), std::sqrt(sigma2) / 3.0) << mean_s;
  }
}

TEST(ArrivalTimes, LostFramesAreFoundOut) {
  Draws draws(5);
  ArrivalTimes filter;
  double off_s = 0.0;
  for (int i = 0; i < 600; ++i) {
    if (i >= 300 && i < 303) continue;
    const double taken_s = 100.0 + period_s * i;
    const FilteredTime given = filter.add(taken_s - 0.005 * std::log(1.0 - draws.uniform()));
    if (i > 400) off_s = std::max(off_s, std::abs(given.t_s - taken_s));
  }
  EXPECT_LT(off_s, 0.01);
}

TEST(StampWatch, JumpsAreFoundAndLatenessIsNone) {
  Draws draws(3);
  StampWatch honest, jumping;
  for (int i = 0; i < 300; ++i) {
    const double taken_s = 100.0 + period_s * i;
    if (i % 29 > 2) honest.add(taken_s, taken_s + 0.01 * draws.uniform());
    if (i % 29 == 0) honest.add(taken_s, taken_s + 2.0 * period_s);  // held back; two were not taken meanwhile
    jumping.add(taken_s - (i / 36 % 3 == 1 ? 0.3 : 0.0), taken_s + 0.01 * draws.uniform());
  }
  EXPECT_EQ(honest.num_jumps(), 0u);
  EXPECT_TRUE(jumping.is_jumping());
  EXPECT_NEAR(jumping.largest_s(), 0.3, 0.02);
}

/// Frames whose intervals differ, by stamps that jump by 0.3 s for one second of three.
TEST(StampWatch, BetweenJumpsStampsStillCount) {
  Draws draws(7);
  StampWatch watch;
  ArrivalTimes by_count;
  std::vector<JumpingStamp> frames;
  std::vector<double> taken, counted;
  double taken_s = 100.0, last_came_s = 0.0;
  for (int i = 0; i < 700; ++i) {
    taken_s += 0.05 + 0.1 * draws.uniform();
    const double stamp_s = taken_s - (std::fmod(taken_s, 3.0) < 1.0 ? 0.3 : 0.0);
    const double held_s = i % 97 == 50 ? 0.4 : 0.0;  // and now and then one is held back, and what follows it
    const double came_s = std::max(last_came_s, taken_s + 0.004 + held_s - 0.002 * std::log(1.0 - draws.uniform()));
    last_came_s = came_s;
    watch.add(stamp_s, came_s);
    frames.push_back({stamp_s, came_s, watch.piece(), watch.came_in_turn()});
    taken.push_back(taken_s + 0.004);
    counted.push_back(by_count.add(came_s).t_s);
  }
  EXPECT_TRUE(watch.is_jumping());
  const PiecedTimes pieced = pieced_times(frames);
  const auto rms = [&](const std::vector<double>& times) {
    double sum2 = 0.0, num = 0.0;
    for (std::size_t i = 200; i < taken.size(); ++i) {
      if (std::isnan(times[i])) continue;
      sum2 += std::pow(times[i] - taken[i], 2);
      num += 1.0;
    }
    EXPECT_GT(num, 440.0);
    return std::sqrt(sum2 / num);
  };
  EXPECT_LT(rms(pieced.t_s), 4.0 * pieced.sigma_s);
  EXPECT_LT(rms(pieced.t_s), 0.001);
  EXPECT_LT(rms(pieced.t_s), 0.5 * rms(counted));
}

}  // namespace
}  // namespace alidade
