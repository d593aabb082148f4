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

/// A truth that nothing can be compared with is no truth of this path: it is named with both times, and nothing is
/// left.
TEST_F(TrackGivenCommand, ATruthOfOtherTimesIsRefused) {
  simulate();
  const Csv truth = Csv::read(path("sim/truth.csv"));
  const std::string live = std::string("'") + ALIDADE_EXECUTABLE + "' track - --quiet --rig '" + path("sim/rig.yaml") +
                           "' --truth '" + path("other.csv") + "' --out '" + path("out") + "' < '" +
                           path("sim/events.csv") + "'";
  const auto refused = [&](double later_s, double until_s, const std::string& what) {
    std::string text = "t_s,x_m,y_m,z_m\n";
    for (std::size_t row = 0; row < truth.num_rows() && truth.number(row, "t_s") < until_s; ++row)
      text += fmt::format("{:.6f},{},{},{}\n", truth.number(row, "t_s") + later_s, truth.text(row, "x_m"),
                          truth.text(row, "y_m"), truth.text(row, "z_m"));
    write_file(path("other.csv"), text);
    for (const testing::Outcome& outcome :
         {track({"--truth", path("other.csv")}), testing::run_program({"sh", "-c", live})}) {
      EXPECT_EQ(outcome.code, 3) << outcome.out;
      EXPECT_THAT(outcome.err, ::testing::HasSubstr("other.csv: is not of the path's times: "));
      EXPECT_THAT(outcome.err, ::testing::HasSubstr(what));
      EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
      EXPECT_FALSE(std::filesystem::exists(path("out")));
    }
  };
  refused(1000.0, 2.0, "1000.000 to 1001.9");
  refused(0.0, 0.005, "0.000 to 0.000 s, the path's are 0.0");
  refused(0.0, 0.295, "positions have their time in it, none of them after the first 0.5 s");
}

TEST_F(TrackGivenCommand, AnOptionByTwoOfItsNamesIsRefused) {
  simulate();
  const testing::Outcome both = track({"--motion", "cv", "--method", "imm"});
  EXPECT_EQ(both.code, 2);
  EXPECT_EQ(both.err, "alidade: error: track: --motion and --method are names of one option, --method: give it once\n");
  EXPECT_EQ(track({"--motion", "cv"}).code, 0);
}

TEST_F(TrackGivenCommand, EstimatesTheNoiseThatIsNotGivenAndSaysSo) {
  const auto sigma_of = [&](const std::vector<std::string>& options) {
    std::vector<std::string> all{"--json", "--truth", path("sim/truth.csv")};
    all.insert(all.end(), options.begin(), options.end());
    const testing::Outcome outcome = track(all);
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    const nlohmann::json document = nlohmann::json::parse(outcome.out);
    EXPECT_EQ(document["verdict"]["state"], "good") << document["verdict"];
    EXPECT_LT(document["estimate"]["nees_per_dof"], 1.8);
    return std::pair(document["estimate"]["sigma_px"].get<double>(),
                     document["estimate"]["sigma_px_from"].get<std::string>());
  };
  for (const double sigma_px : {0.2, 1.0, 2.0}) {
    const std::string given = fmt::format("{}", sigma_px);
    simulate({"--sigma-px", given, "--seed", "5"});
    const auto [found_px, from] = sigma_of({});
    EXPECT_NEAR(found_px, sigma_px, 0.15 * sigma_px + 0.05);
    EXPECT_EQ(from, "residuals");
    EXPECT_THAT(track({}).out, ::testing::HasSubstr(" px (estimated from the innovations)"));
    EXPECT_EQ(sigma_of({"--sigma-px", given}), std::pair(sigma_px, std::string("given")));
  }
  simulate({"--seed", "5"});
  EXPECT_EQ(sigma_of({}), std::pair(0.5, std::string("default")));
}

/// What is wrong with a rig and in no σ of it makes no good track; what its σ has does.
TEST_F(TrackGivenCommand, TheCauseOfARigThatIsWrongIsPassedOn) {
  simulate();
  const std::string rig = read_file(path("sim/rig.yaml"));
  write_file(path("sim/rig.yaml"), rig + "verdict: care\nverdict_sentence: \"± 9 mm\"\n");
  EXPECT_THAT(track({}).out, ::testing::HasSubstr("● "));
  write_file(path("sim/rig.yaml"),
             rig + "verdict: care\nverdict_sentence: \"± 9 mm\"\nverdict_cause: \"head1.camera.cy is 230\"\n");
  const testing::Outcome outcome = track({});
  EXPECT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, ::testing::HasSubstr("rig.yaml says ◆: head1.camera.cy is 230"));
  EXPECT_THAT(outcome.out, ::testing::Not(::testing::HasSubstr("● ")));
}

}  // namespace
}  // namespace alidade
