#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "alidade/testing/command_test.h"

// `alidade plan` on results that stand, that are not to be trusted, and that were refused.

namespace alidade {
namespace {

using testing::Outcome;

class PlanCommand : public testing::CommandTest {
 protected:
  /// `plan` on the result in `out` with another exit code in it.
  [[nodiscard]] Outcome plan_after(int exit_code, const std::string& command) const {
    auto document = nlohmann::json::parse(read_file(path("out/result.json")));
    document["verdict"]["exit_code"] = exit_code;
    document["verdict"]["to_add"] = "more";
    write_file(path("out/result.json"), document.dump());
    return alidade({"plan", command, path("out"), "--out", path("plan"), "--no-report"});
  }
  /// An estimate that is not to be trusted is an estimate; a refusal is none.
  void expect_planned(const std::string& command) const {
    for (const int code : {0, 6}) {
      const Outcome outcome = plan_after(code, command);
      EXPECT_EQ(outcome.code, 0) << code << ": " << outcome.err;
    }
    for (const int code : {4, 5}) {
      const Outcome outcome = plan_after(code, command);
      EXPECT_EQ(outcome.code, 3) << code;
      EXPECT_THAT(outcome.err, ::testing::HasSubstr("was refused"));
    }
  }
  void run(const std::vector<std::string>& words) const {
    const Outcome outcome = alidade(words, {"--no-report"});
    ASSERT_EQ(outcome.code, 0) << outcome.err;
  }
};

TEST_F(PlanCommand, TakesACalibrationThatHasACamera) {
  run({"simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "8", "--corners-only", "--size",
       "640x480", "--out", path("sim")});
  run({"calibrate", "--corners", path("sim/corners.csv"), "--size", "640x480", "--board", "9x6", "--square", "0.025",
       "--out", path("out")});
  expect_planned("calibrate");
}

TEST_F(PlanCommand, TakesAnObservationThatHasACamera) {
  run({"simulate", "rotation", "--duration", "4", "--out", path("sim")});
  run({"observe", path("sim/log.csv"), "--out", path("out")});
  expect_planned("observe");
}

TEST_F(PlanCommand, TakesARangefinderThatHasABeam) {
  run({"simulate", "rangefinder", "--shots", "8", "--out", path("sim")});
  run({"rangefinder", path("sim/shots.csv"), "--camera", path("sim/camera.yaml"), "--corners", path("sim/corners.csv"),
       "--board", "9x6", "--square", "0.04", "--out", path("out")});
  expect_planned("rangefinder");
}

}  // namespace
}  // namespace alidade
