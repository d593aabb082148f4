#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;

class LocalizeNoise : public testing::CommandTest {
 protected:
  void simulate(const std::vector<std::string>& options) {
    const Outcome made = alidade({"simulate", "underwater", "--out", path("sim"), "--quiet", "--no-report"}, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] Outcome localize(const std::vector<std::string>& options) {
    return alidade({"localize", path("sim/sights.csv"), "--camera", path("sim/camera.yaml"), "--target",
                    path("sim/target.yaml"), "--out", path("out"), "--no-report"},
                   options);
  }
};

TEST_F(LocalizeNoise, IsEstimatedWhereItIsNotGivenAndItSaysSo) {
  const auto sigma_of = [&](const std::vector<std::string>& options) {
    std::vector<std::string> all{"--start", path("sim/start.yaml"), "--truth", path("sim/truth.tum"), "--json"};
    all.insert(all.end(), options.begin(), options.end());
    const Outcome outcome = localize(all);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json document = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(document["verdict"]["state"], "good") << document["verdict"];
    EXPECT_LT(document["estimate"]["nees_per_dof"], 2.0);
    return std::pair(document["estimate"]["sigma_px"].get<double>(),
                     document["estimate"]["sigma_px_from"].get<std::string>());
  };
  for (const double sigma_px : {0.2, 2.0}) {
    const std::string stated = fmt::format("{}", sigma_px);
    simulate({"--sigma-px", stated, "--points", "30", "--frames", "100", "--rate", "30"});
    const auto [found_px, from] = sigma_of({});
    EXPECT_NEAR(found_px, sigma_px, 0.12 * sigma_px);
    EXPECT_EQ(from, "residuals");
    EXPECT_THAT(localize({}).out, ::testing::HasSubstr(" px (estimated from the tracks)"));
    EXPECT_EQ(sigma_of({"--sigma-px", stated}), std::pair(sigma_px, std::string("given")));
  }
  simulate({});
  EXPECT_EQ(sigma_of({}), std::pair(0.5, std::string("default")));
}

/// Of four known points two in five show another one: now and then a pose fits all four by chance, and the other points
/// say that the camera is not there.
TEST_F(LocalizeNoise, ChancePosesOfAMismatchedTargetDoNotMoveThePath) {
  simulate({"--mismatches", "0.4", "--points", "40", "--frames", "90", "--rate", "30", "--seed", "17"});
  const Outcome outcome = localize({"--truth", path("sim/truth.tum"), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json estimate = nlohmann::json::parse(outcome.out)["estimate"];
  EXPECT_LT(estimate["ate_m"], 0.0015) << estimate;      // 0.7 mm; where a chance pose begins another path 3 mm
  EXPECT_LT(estimate["nees_per_dof"], 3.7) << estimate;  // χ²₆/6 at 99.9 %
}

/// Without known points a mirrored world explains mirrored images.
TEST_F(LocalizeNoise, ThatImagesAreNotMirroredIsAssumedWithoutKnownPoints) {
  simulate({"--points", "30", "--frames", "30", "--rate", "30"});
  const auto assumes = [&](const std::vector<std::string>& options) {
    const Outcome outcome = alidade({"localize", path("sim/sights.csv"), "--camera", path("sim/camera.yaml"), "--out",
                                     path("out"), "--no-report", "--json"},
                                    options);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json assumed = nlohmann::json::parse(outcome.out)["assumed"];
    return std::ranges::any_of(assumed,
                               [](const nlohmann::json& row) { return row["name"] == "images are not mirrored"; });
  };
  EXPECT_TRUE(assumes({}));
  EXPECT_FALSE(assumes({"--target", path("sim/target.yaml")}));
}

}  // namespace
}  // namespace alidade
