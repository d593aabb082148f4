#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "alidade/identify.h"
#include "alidade/results/identify_outcome.h"
#include "alidade/testing/servo_sample.h"

// The whole job through its public header: the same plant as from the parts, and an answer to every misuse.

namespace alidade {
namespace {

using testing::late_scene;
using testing::log_of;

TEST(IdentifyFace, IsTheWholeJob) {
  for (const bool is_rate_plant : {false, true}) {
    const auto log = log_of(late_scene(is_rate_plant));
    const Identification result = identify(log, {.sigma_clock = 0.0});
    const ServoIdentification part = identify_servo(log);
    EXPECT_EQ(result.fit.params, part.fit.params);
    EXPECT_EQ(result.fit.cov, part.fit.cov);
    EXPECT_EQ(result.status, ServoIdentification::Status::converged);
    EXPECT_EQ(result.verdict.sentence, identify_verdict(log, part).sentence);
    EXPECT_EQ(result.counts.given, log.size());
    EXPECT_EQ(result.counts.used, log.size());
    EXPECT_FALSE(result.assumed.empty());
    const JobOutcome outcome = outcome_of(result);
    ASSERT_EQ(outcome.files.size(), 1u);
    EXPECT_EQ(outcome.files[0].name, "servo.yaml");
  }
}

TEST(IdentifyFace, AKindThatIsKnownIsBelieved) {
  const auto log = log_of(late_scene(true));
  EXPECT_EQ(identify(log, {.kind = ServoKindRule::rate}).fit.kind, ServoKind::rate);
  EXPECT_EQ(identify(log, {.kind = ServoKindRule::angle}).fit.kind, ServoKind::angle);
  EXPECT_EQ(identify(log).fit.params, identify(log, {.kind = ServoKindRule::rate}).fit.params);
  EXPECT_THROW((void)identify(log, {.kind = static_cast<ServoKindRule>(9)}), ConfigError);
}

TEST(IdentifyFace, AnswersLogsThatCannotBe) {
  const auto log = log_of(late_scene(false));
  const double inf = std::numeric_limits<double>::infinity();
  for (const double bad : {std::nan(""), inf, -inf, 1e300}) {
    for (double ServoSample::*const member : {&ServoSample::t_s, &ServoSample::command, &ServoSample::angle_rad}) {
      auto spoilt = log;
      spoilt[7].*member = bad;
      EXPECT_THROW((void)identify(spoilt), ConfigError) << bad;
    }
  }
  auto backwards = log;
  std::swap(backwards[3], backwards[4]);
  EXPECT_THROW((void)identify(backwards), ConfigError);
  auto twice = log;
  twice[4].t_s = twice[3].t_s;
  EXPECT_THROW((void)identify(twice), ConfigError);
}

TEST(IdentifyFace, AnswersEmptyInput) {
  for (const std::size_t rows : {0u, 1u, 19u}) {
    auto log = log_of(late_scene(false));
    log.resize(rows);
    const Identification result = identify(log);
    EXPECT_EQ(result.verdict.exit_code, ExitCode::undetermined);
    EXPECT_EQ(result.status, ServoIdentification::Status::degenerate);
    EXPECT_EQ(outcome_of(result).document.counts.given, rows);
  }
  std::vector<ServoSample> still;
  for (int i = 0; i < 50; ++i) still.push_back({.t_s = 0.01 * i, .command = 1.0, .angle_rad = 0.2});
  EXPECT_EQ(identify(still).verdict.exit_code, ExitCode::undetermined);
}

}  // namespace
}  // namespace alidade
