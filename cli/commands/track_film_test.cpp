#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

/// Two heads film a red ball.
class TrackFilm : public testing::CommandTest {
 protected:
  void film(const std::string& duration_s) const {
    const Outcome made = alidade(
        {"simulate", "track", "--scenario", "B", "--video", "--duration", duration_s, "--out", path("sim"), "--quiet"});
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] Outcome watch(const std::vector<std::string>& options) const {
    return alidade({"track", "--video", path("sim/head_1"), path("sim/head_2"), "--rig", path("sim/rig.yaml"), "--out",
                    path("out"), "--no-report"},
                   options);
  }
};

TEST_F(TrackFilm, TargetIsFoundInTheFramesAndFollowed) {
  film("1.5");
  const Outcome outcome =
      watch({"--angles", path("sim/angles.csv"), "--look", "colour:230,70,20", "--truth", path("sim/truth.csv")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(read_file(path("out/result.json")));
  for (const Json& video : document["estimate"]["video"]) {
    EXPECT_EQ(video["frames"], 31);  // 0, 0.05, … 1.5 s
    EXPECT_GE(video["seen"], 28);
  }
  EXPECT_LT(document["estimate"]["rms_m"], 0.006);  // scenario B from pixels of σ 0.5: 3.1 mm; the start is in it
  EXPECT_GT(document["estimate"]["nees_per_dof"], 0.3);
  EXPECT_LT(document["estimate"]["nees_per_dof"], 3.0);
  // its observations are events
  const Outcome again =
      alidade({"track", path("out/events.csv"), "--rig", path("sim/rig.yaml"), "--out", path("again")});
  EXPECT_EQ(again.code, 0) << again.err;
}

TEST_F(TrackFilm, WhatIsNotInTheFramesIsSaid) {
  film("0.5");
  const Outcome outcome = watch({"--angles", path("sim/angles.csv"), "--target", "colour:0,0,255"});
  EXPECT_EQ(outcome.code, 4);
  EXPECT_NE(outcome.err.find("the target is in no frame"), std::string::npos) << outcome.err;
}

TEST_F(TrackFilm, SaysWhatIsWrongWithItsInput) {
  film("0.5");
  const std::string angles = read_file(path("sim/angles.csv"));
  const auto fault = [&](const std::string& text, const std::string& target = "colour:230,70,20") {
    write_file(path("angles.csv"), text);
    const Outcome outcome = watch({"--angles", path("angles.csv"), "--target", target});
    return std::to_string(outcome.code) + " " + outcome.err;
  };
  using ::testing::HasSubstr;
  EXPECT_THAT(fault(angles, "colour:230,70"), AllOf(HasSubstr("2 "), HasSubstr("colour:R,G,B")));
  EXPECT_THAT(fault(angles, "colour:90,90,90"), AllOf(HasSubstr("2 "), HasSubstr("no hue")));
  EXPECT_THAT(fault(angles, "marker:DICT_9X9:1"), AllOf(HasSubstr("2 "), HasSubstr("not a dictionary")));
  EXPECT_THAT(fault(angles, "pattern:nowhere.png"), AllOf(HasSubstr("3 "), HasSubstr("nowhere.png")));
  EXPECT_THAT(fault("t_s,head,pan_rad,tilt_rad\n"), HasSubstr("3 "));
  EXPECT_THAT(fault("t_s,pan_rad,tilt_rad\n0,0,0\n"), AllOf(HasSubstr("3 "), HasSubstr("no column 'head'")));
  EXPECT_THAT(fault("t_s,head,pan_deg,tilt_px\n0,1,0,0\n"), AllOf(HasSubstr("3 "), HasSubstr("'tilt_rad'")));
  EXPECT_THAT(fault("t_s,head,pan_rad,tilt_rad\n0,1,0,0\n0,1,0,0\n"),
              AllOf(HasSubstr("3 "), HasSubstr("is not after")));
  EXPECT_THAT(fault("t_s,head,pan_rad,tilt_rad\n0,1,0,nan\n"),
              AllOf(HasSubstr("3 "), HasSubstr("not a finite number")));
  EXPECT_THAT(fault("t_s,head,pan_rad,tilt_rad\n0,1,0,0\n"), AllOf(HasSubstr("3 "), HasSubstr("no rows of head 2")));
  EXPECT_THAT(fault("t_s,head,pan_rad,tilt_rad\n0,1,0,0\n0,2,0,0\n"),
              AllOf(HasSubstr("3 "), HasSubstr("one row a frame is needed")));
}

}  // namespace
}  // namespace alidade
