#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

/// Both lenses zoom, one in and one out: with the intrinsics of each time the track is as good as without a zoom.
class ZoomingTrackCommand : public testing::CommandTest {
 protected:
  static double factor(int head, double t_s) { return std::exp((head == 1 ? 0.6 : -0.6) * std::sin(0.6 * t_s)); }

  void SetUp() override {
    testing::CommandTest::SetUp();
    const Outcome made =
        alidade({"simulate", "track", "--scenario", "B", "--duration", "6", "--out", path("sim"), "--quiet"});
    ASSERT_EQ(made.code, 0) << made.err;
    const Csv csv = Csv::read(path("sim/events.csv"));
    std::string text = "t_capture_s,t_arrival_s,head,pan_rad,tilt_rad,u_px,v_px\n";
    for (std::size_t row = 0; row < csv.num_rows(); ++row) {
      const double zoom = factor(static_cast<int>(csv.integer(row, "head", 1, 2)), csv.number(row, "t_capture_s"));
      text += fmt::format("{},{},{},{},{},{:.4f},{:.4f}\n", csv.text(row, "t_capture_s"), csv.text(row, "t_arrival_s"),
                          csv.text(row, "head"), csv.text(row, "pan_rad"), csv.text(row, "tilt_rad"),
                          160.0 + zoom * (csv.number(row, "u_px") - 160.0),
                          120.0 + zoom * (csv.number(row, "v_px") - 120.0));
    }
    write_file(path("zoomed.csv"), text);
    for (const int head : {1, 2}) write_intrinsics(head, 6.0);
  }
  void write_intrinsics(int head, double until_s) {
    std::string text = "t_s,fx,fy,cx,cy,sigma_fx,sigma_fy,sigma_cx,sigma_cy,nis,event\n0,,,,,,,,,,\n";
    for (double t_s = 0.05; t_s <= until_s; t_s += 0.05) {
      const double f = 337.84 * factor(head, t_s);
      text += fmt::format("{:.3f},{:.6f},{:.6f},160,120,{:.6f},{:.6f},0.2,0.2,,\n", t_s, f, f, 1e-3 * f, 1e-3 * f);
    }
    write_file(path(fmt::format("intrinsics_{}.csv", head)), text);
  }
  [[nodiscard]] Outcome track_zoomed(const std::vector<std::string>& options) {
    const std::vector<std::string> arguments{"track",   path("zoomed.csv"),   "--rig",  path("sim/rig.yaml"),
                                             "--out",   path("out"),          "--json", "--no-report",
                                             "--truth", path("sim/truth.csv")};
    return alidade(arguments, options);
  }
};

TEST_F(ZoomingTrackCommand, TakesEachObservationWithTheLensOfItsTime) {
  const Outcome outcome = track_zoomed({"--intrinsics", path("intrinsics_1.csv"), path("intrinsics_2.csv")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_LT(document["estimate"]["rms_m"], 0.006);
  EXPECT_LT(document["estimate"]["nees_per_dof"], 2.0);
  const auto is_course = [](const Json& one) { return one["name"] == "head2.intrinsics.fx"; };
  const auto& assumed = document["assumed"];
  const auto fx = std::find_if(assumed.begin(), assumed.end(), is_course);
  ASSERT_NE(fx, assumed.end());
  EXPECT_NEAR((*fx)["sigma"], 0.338, 0.01);  // 0.1 % of the rig's own
  EXPECT_EQ(document["inputs"].size(), 5u);
  const Outcome blind = track_zoomed({});
  if (blind.code == 0) {
    EXPECT_GT(Json::parse(blind.out)["estimate"]["rms_m"], 0.05);
  }
}

TEST_F(ZoomingTrackCommand, ReadsThemFromTheRigAsWell) {
  std::string rig = read_file(path("sim/rig.yaml"));
  for (const int head : {1, 2}) {
    const std::string id = fmt::format("id: {}", head);
    const auto at = rig.find(id);
    ASSERT_NE(at, std::string::npos);
    rig.replace(at, id.size(), fmt::format("{}\n    intrinsics: ../intrinsics_{}.csv", id, head));
  }
  write_file(path("sim/rig.yaml"), rig);
  const Outcome outcome = track_zoomed({});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_LT(Json::parse(outcome.out)["estimate"]["rms_m"], 0.006);
  const Outcome projected = alidade({"project", "--rig", path("sim/rig.yaml"), "--pan", "0.1", "--pan", "0.1", "--tilt",
                                     "0", "--tilt", "0", "--out", path("projected")});
  EXPECT_EQ(projected.code, 3) << projected.err;
}

TEST_F(ZoomingTrackCommand, RefusesWhatDoesNotFit) {
  EXPECT_EQ(track_zoomed({"--intrinsics", path("intrinsics_1.csv")}).code, 2);
  EXPECT_EQ(track_zoomed({"--intrinsics", path("none.csv"), "-"}).code, 3);
  write_intrinsics(2, 2.0);
  const Outcome outside = track_zoomed({"--intrinsics", "-", path("intrinsics_2.csv")});
  EXPECT_EQ(outside.code, 3);
  EXPECT_THAT(outside.err, ::testing::HasSubstr("are the clocks the same?"));
}

}  // namespace
}  // namespace alidade
