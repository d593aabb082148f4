#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

/// Scenario B, and what is said of it beside its events.
class TrackGivenCommand : public testing::CommandTest {
 protected:
  void simulate(const std::vector<std::string>& options = {}) {
    const std::vector<std::string> words{"simulate", "track", "--scenario", "B", "--out", path("sim"), "--quiet"};
    const testing::Outcome made = alidade(words, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] testing::Outcome track(const std::vector<std::string>& options) {
    const std::vector<std::string> words{"track",     path("sim/events.csv"), "--rig", path("sim/rig.yaml"), "--out",
                                         path("out"), "--no-report"};
    return alidade(words, options);
  }
};

TEST_F(TrackGivenCommand, AnOptionByTwoOfItsNamesIsRefused) {
  simulate();
  const testing::Outcome both = track({"--motion", "cv", "--method", "imm"});
  EXPECT_EQ(both.code, 2);
  EXPECT_EQ(both.err, "alidade: error: track: --motion and --method are names of one option, --method: give it once\n");
  EXPECT_EQ(track({"--motion", "cv"}).code, 0);
}

}  // namespace
}  // namespace alidade
