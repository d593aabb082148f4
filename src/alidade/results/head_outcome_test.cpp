#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "alidade/heads/head_follow.h"
#include "alidade/results/head_outcome.h"
#include "alidade/results/result_document.h"

namespace alidade {
namespace {

/// It was 0 px RMS.
TEST(HeadOutcome, ATargetThatWasNeverSeenHasNoDistance) {
  HeadFollowing following;
  following.frames.resize(3);
  following.verdict.state = State::refused;
  const JobOutcome outcome = outcome_of(following);
  const nlohmann::json estimate = nlohmann::json::parse(result_text(outcome.document))["estimate"];
  for (const char* name : {"rms_px", "max_px", "central_third"}) EXPECT_TRUE(estimate[name].is_null()) << name;
  for (const std::string& line : outcome.lines) EXPECT_EQ(line.find("RMS"), std::string::npos) << line;
}

}  // namespace
}  // namespace alidade
