#include "alidade/study/trial_random.h"

#include <gtest/gtest.h>

#include <cmath>
#include <set>

namespace alidade {
namespace {

/// Known answers of Philox4x32-10, from the Random123 distribution (kat_vectors).
TEST(Philox, GivesTheKnownAnswers) {
  using Words = std::array<std::uint32_t, 4>;
  EXPECT_EQ(philox({0, 0, 0, 0}, {0, 0}), (Words{0x6627e8d5, 0xe169c58d, 0xbc57ac4c, 0x9b00dbd8}));
  constexpr std::uint32_t all = 0xffffffff;
  EXPECT_EQ(philox({all, all, all, all}, {all, all}), (Words{0x408f276d, 0x41c83b0e, 0xa20bc7c6, 0x6d5451fd}));
  EXPECT_EQ(philox({0x243f6a88, 0x85a308d3, 0x13198a2e, 0x03707344}, {0xa4093822, 0x299f31d0}),
            (Words{0xd16cfe09, 0x94fdcceb, 0x5001e420, 0x24126ea1}));
}

TEST(TrialRandom, IsAFunctionOfSeedStudyAndTrialAlone) {
  TrialRandom one(7, "observe", 41), again(7, "observe", 41);
  for (int i = 0; i < 1000; ++i) EXPECT_EQ(one.bits(), again.bits());
  EXPECT_EQ(one.seed(), TrialRandom(7, "observe", 41).seed());  // whatever was drawn meanwhile
  std::set<std::uint64_t> seeds;
  for (std::uint64_t seed = 0; seed < 20; ++seed)
    for (std::uint64_t trial = 0; trial < 50; ++trial)
      for (const char* study : {"observe", "track"}) seeds.insert(TrialRandom(seed, study, trial).seed());
  EXPECT_EQ(seeds.size(), 2000U);
}

/// Moments of 4 million draws within five of their standard errors, and shares of the tails.
TEST(TrialRandom, IsNormal) {
  constexpr int num = 4000000;
  TrialRandom random(1, "normal", 0);
  double sum = 0.0, sum2 = 0.0, sum4 = 0.0;
  int beyond2 = 0, beyond35 = 0;
  for (int i = 0; i < num; ++i) {
    const double x = random.normal();
    sum += x;
    sum2 += x * x;
    sum4 += x * x * x * x;
    beyond2 += std::abs(x) > 2.0;
    beyond35 += std::abs(x) > 3.5;  // the ziggurat's tail begins at 3.44
  }
  const double root = std::sqrt(static_cast<double>(num));
  EXPECT_NEAR(sum / num, 0.0, 5.0 / root);
  EXPECT_NEAR(sum2 / num, 1.0, 5.0 * std::sqrt(2.0) / root);
  EXPECT_NEAR(sum4 / num, 3.0, 5.0 * std::sqrt(96.0) / root);
  const auto near = [&](int count, double share) {
    EXPECT_NEAR(static_cast<double>(count), num * share, 5.0 * std::sqrt(num * share));
  };
  near(beyond2, std::erfc(2.0 / std::sqrt(2.0)));
  near(beyond35, std::erfc(3.5 / std::sqrt(2.0)));
}

}  // namespace
}  // namespace alidade
