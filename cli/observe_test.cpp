#include <gtest/gtest.h>

#include "alidade/testing/process.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using testing::Outcome;

/// A simulated log, observed; what the command says and its exit code.
Outcome observe_motion(const std::string& motion) {
  const testing::TemporaryFolder folder;
  const std::string log = (folder.path() / "log").string(), out = (folder.path() / "out").string();
  const Outcome made = testing::run_program(
      {ALIDADE_EXECUTABLE, "simulate", "rotation", "--motion", motion, "--duration", "6", "--out", log});
  EXPECT_EQ(made.code, 0) << made.err;
  return testing::run_program(
      {ALIDADE_EXECUTABLE, "observe", log + "/log.csv", "--size", "780x582", "--out", out, "--no-report"});
}

TEST(Observe, RefusesByNameWhatTheMotionCannotTell) {
  EXPECT_EQ(observe_motion("sway").code, 0);
  const auto expect = [](const std::string& motion, const std::string& reason) {
    const Outcome outcome = observe_motion(motion);
    EXPECT_EQ(outcome.code, 4) << motion;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << outcome.err;
  };
  expect("pan", "pan only: fy cannot be told; tilt the camera as well");
  expect("tilt", "tilt only: fx cannot be told; pan the camera as well");
  expect("roll", "roll only");
  expect("still", "does not turn");
}

TEST(Observe, SaysWhatIsWrongWithItsInput) {
  const testing::TemporaryFolder folder;
  const auto expect = [&](const std::vector<std::string>& arguments, int code, const std::string& what) {
    std::vector<std::string> command{ALIDADE_EXECUTABLE, "observe", "--out", (folder.path() / "out").string()};
    command.insert(command.end(), arguments.begin(), arguments.end());
    const Outcome outcome = testing::run_program(command);
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
  };
  expect({}, 2, "give a rotation log, or --pairs FILE");
  expect({"none.csv", "--method", "best"}, 2, "--method");
  expect({"none.csv", "--estimate", "k9"}, 2, "--estimate: 'k9' is not k1, mount, delay or lever");
  expect({"none.csv", "--start", "1,2,3,nan"}, 2, "--start");
  expect({(folder.path() / "none.csv").string()}, 3, "none.csv");
  EXPECT_FALSE(std::filesystem::exists(folder.path() / "out"));
}

}  // namespace
}  // namespace alidade
