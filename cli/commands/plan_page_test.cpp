#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

// What the pages of `plan` are drawn from: the camera, the board in its own frame, and what is known now and then.

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class PlanPage : public testing::CommandTest {
 protected:
  [[nodiscard]] Json plan(const std::string& command) const {
    const Outcome outcome = alidade({"plan", command, path("out"), "--json", "--no-report", "--out", path("plan")});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return outcome.code == 0 ? Json::parse(outcome.out) : Json();
  }
  [[nodiscard]] Json result() const { return Json::parse(read_file(path("out/result.json"))); }
};

/// The board's points are where a printed board has them: the first at the origin, squares of 25 mm, 9 × 6 corners.
TEST_F(PlanPage, OfACalibrationHoldsItsCameraAndItsBoard) {
  ASSERT_EQ(alidade({"simulate", "board", "--board", "9x6", "--square", "0.025", "--photos", "8", "--corners-only",
                     "--size", "640x480", "--no-report", "--out", path("in")})
                .code,
            0);
  ASSERT_EQ(alidade({"calibrate", "--corners", path("in/corners.csv"), "--board", "9x6", "--square", "0.025", "--size",
                     "640x480", "--no-report", "--out", path("out")})
                .code,
            0);
  const Json document = plan("calibrate"), points = document["data"]["points_in_board"];
  ASSERT_EQ(points["x_m"].size(), 54u);
  for (std::size_t i = 0; i < 54; ++i) {
    EXPECT_NEAR(points["x_m"][i], 0.025 * static_cast<double>(i % 9), 2e-4);  // as solved: a shape may have been
    EXPECT_NEAR(points["y_m"][i], 0.025 * static_cast<double>(i / 9), 2e-4);
    EXPECT_NEAR(points["z_m"][i], 0.0, 1e-3);
  }
  EXPECT_EQ(document["estimate"]["camera"]["fx"], result()["estimate"]["camera"]["fx"]);
  EXPECT_EQ(document["estimate"]["camera"]["width"], 640);
  EXPECT_LT(document["estimate"]["planned_worst_3sigma_px"], document["estimate"]["worst_3sigma_px"]);
}

TEST_F(PlanPage, OfAnObservationHoldsTheImageAndBothSigmas) {
  ASSERT_EQ(alidade({"simulate", "rotation", "--duration", "8", "--no-report", "--out", path("in")}).code, 0);
  ASSERT_EQ(alidade({"observe", path("in/log.csv"), "--size", "780x582", "--no-report", "--out", path("out")}).code, 0);
  const Json document = plan("observe"), observed = result(), estimate = document["estimate"];
  EXPECT_EQ(estimate["camera"]["width"], 780);
  EXPECT_EQ(estimate["camera"]["height"], 582);
  for (const char* name : {"fx", "fy", "cx", "cy"}) {
    EXPECT_NEAR(estimate["camera"][name], observed["estimate"]["camera"][name], 1e-6) << name;
    EXPECT_LT(estimate["sigma_planned_px"][name], estimate["sigma_now_px"][name]) << name;
  }
}

TEST_F(PlanPage, OfARangefinderHoldsItsBeam) {
  ASSERT_EQ(alidade({"simulate", "rangefinder", "--shots", "8", "--no-report", "--out", path("in")}).code, 0);
  ASSERT_EQ(alidade({"rangefinder", path("in/shots.csv"), "--camera", path("in/camera.yaml"), "--corners",
                     path("in/corners.csv"), "--board", "9x6", "--square", "0.04", "--no-report", "--out", path("out")})
                .code,
            0);
  const Json document = plan("rangefinder"), estimate = document["estimate"], beam = result()["estimate"];
  double length = 0.0;
  for (std::size_t k = 0; k < 3; ++k) {
    EXPECT_NEAR(estimate["origin_m"][k], beam["origin_m"][k], 1e-9);
    length += std::pow(estimate["direction"][k].get<double>(), 2);
  }
  EXPECT_NEAR(length, 1.0, 1e-9);
  EXPECT_LT(estimate["sigma_planned_direction_rad"], estimate["sigma_now_direction_rad"]);
  EXPECT_EQ(document["data"]["points_in_board"]["x_m"].size(), 54u);
}

}  // namespace
}  // namespace alidade
