#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

// `alidade calibrate --model flat_port`, from simulated boards in water.

namespace alidade {
namespace {

using nlohmann::json;
using ::testing::HasSubstr;
using testing::Outcome;

constexpr const char* lens = "fx: 576\nfy: 575\ncx: 384\ncy: 288\nk1: -0.12\nk2: 0.05\np1: 0\np2: 0\nk3: 0\n";
constexpr const char* port = "gap_m: 0.05\nglass_m: 0.01\nn_glass: 1.5\nn_water: 1.34\nnormal: [0.02, -0.01, 1.0]\n";

class CalibratePortCommand : public testing::CommandTest {
 protected:
  CalibratePortCommand() {
    const std::string size = "width: 768\nheight: 576\n";
    write_file(path("air.yaml"), "model: brown\n" + size + lens);
    write_file(path("port.yaml"), "model: flat_port\n" + size + lens + port);
  }

  /// Corners of 30 boards in water.
  void simulate(const std::string& max_tilt_deg) const {
    const Outcome made =
        alidade({"simulate", "board", "--camera", path("port.yaml"), "--photos", "30", "--corners-only", "--sigma-px",
                 "0.3", "--max-tilt-deg", max_tilt_deg, "--out", path("water"), "--quiet"},
                board_);
    ASSERT_EQ(made.code, 0) << made.err;
  }

  [[nodiscard]] Outcome calibrate(const std::vector<std::string>& options) const {
    std::vector<std::string> words{"calibrate", "--corners",   path("water/corners.csv"),
                                   "--size",    "768x576",     "--out",
                                   path("out"), "--no-report", "--json"};
    words.insert(words.end(), board_.begin(), board_.end());
    return alidade(words, options);
  }

 private:
  std::vector<std::string> board_{"--board", "9x6", "--square", "0.06"};
};

TEST_F(CalibratePortCommand, FindsGapAndNormalAndSaysWhetherBrownWouldDo) {
  simulate("35");
  const Outcome run = calibrate({"--model", "flat_port", "--air", path("air.yaml"), "--glass", "0.01"});
  ASSERT_EQ(run.code, 0) << run.err;
  const json estimate = json::parse(run.out)["estimate"];
  const json& camera = estimate["camera"];
  EXPECT_EQ(camera["model"], "flat_port");
  EXPECT_EQ(camera["fx"], 576.0);
  EXPECT_NEAR(double(camera["gap_m"]), 0.05, 1.5e-3);
  EXPECT_NEAR(double(camera["normal"][0]), 0.02, 0.005);  // 0.3°
  EXPECT_NEAR(double(camera["normal"][1]), -0.01, 0.005);
  EXPECT_EQ(estimate["port"]["brown_is_enough"], false);
  EXPECT_NEAR(double(estimate["port"]["brown_rms_px"][0]), 1.5, 0.4);
  // The camera that it writes is one that other commands read, or refuse by name.
  EXPECT_EQ(alidade({"camera", "show", path("out/camera.yaml"), "--quiet"}).code, 0);
  const Outcome refused = alidade({"camera", "convert", path("out/camera.yaml"), path("x.yaml"), "--to", "opencv"});
  EXPECT_EQ(refused.code, 3);
  EXPECT_THAT(refused.err, HasSubstr("opencv has no lens like flat_port"));
  const Outcome undistort = alidade({"camera", "undistort", path("out/camera.yaml"), path("a.png")});
  EXPECT_EQ(undistort.code, 3);
  EXPECT_THAT(undistort.err, HasSubstr("has no single viewpoint"));
}

TEST_F(CalibratePortCommand, RefusesAFreeLensFromParallelBoards) {
  simulate("0");
  const Outcome run = calibrate({"--model", "flat_port", "--glass", "0.01"});
  EXPECT_EQ(run.code, 4) << run.err;
  EXPECT_THAT(std::string(json::parse(run.out)["verdict"]["sentence"]), HasSubstr("cannot be determined"));
}

TEST_F(CalibratePortCommand, SaysWhatIsMissing) {
  simulate("35");
  Outcome run = calibrate({"--model", "flat_port"});
  EXPECT_EQ(run.code, 2);
  EXPECT_THAT(run.err, HasSubstr("--glass 0.01"));
  run = calibrate({"--air", path("air.yaml")});
  EXPECT_EQ(run.code, 2);
  EXPECT_THAT(run.err, HasSubstr("are of --model flat_port"));
  run = calibrate({"--model", "flat_port", "--glass", "0.01", "--air", path("port.yaml")});
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.err, HasSubstr("has no single viewpoint"));
  write_file(path("small.yaml"), std::string("model: brown\nwidth: 640\nheight: 480\n") + lens);
  run = calibrate({"--model", "flat_port", "--glass", "0.01", "--air", path("small.yaml")});
  EXPECT_EQ(run.code, 3);
  EXPECT_THAT(run.err, HasSubstr("is of 640x480 px, but the photos are 768x576"));
}

}  // namespace
}  // namespace alidade
