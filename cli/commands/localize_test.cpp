#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/tables/localize_file.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class LocalizeCommand : public testing::CommandTest {
 protected:
  void simulate(const std::vector<std::string>& options = {}) {
    const Outcome made = alidade({"simulate", "underwater", "--out", path("sim"), "--quiet", "--no-report"}, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] Outcome localize(const std::vector<std::string>& options,
                                 const std::string& observations = "sim/sights.csv") {
    return alidade(
        {"localize", path(observations), "--camera", path("sim/camera.yaml"), "--out", path("out"), "--no-report"},
        options);
  }
  [[nodiscard]] std::vector<std::string> given(std::vector<std::string> more = {}) const {
    more.insert(more.end(), {"--target", path("sim/target.yaml"), "--start", path("sim/start.yaml"), "--truth",
                             path("sim/truth.tum"), "--json"});
    return more;
  }
};

TEST_F(LocalizeCommand, GivesThePathWithTheNamesOfTheContract) {
  simulate();
  const Outcome outcome = localize(given());
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  const Json& estimate = document["estimate"];
  EXPECT_EQ(estimate["frames"], 35);
  EXPECT_EQ(estimate["lost"], 0);
  EXPECT_LT(estimate["ate_m"], 0.03);
  EXPECT_LT(estimate["rpe_m"], 0.03);
  EXPECT_EQ(estimate["scale_known"], true);
  EXPECT_GT(estimate["nis_per_dof"], 0.4);
  EXPECT_LT(estimate["nis_per_dof"], 1.2);
  EXPECT_EQ(document["verdict"]["state"], "good");
  const Json& rows = document["data"]["path"];
  EXPECT_EQ(rows["t_s"].size(), 35u);
  for (const char* name :
       {"world_from_cam_x_m", "world_from_cam_qw", "truth_x_m", "num_tracked", "num_gated", "nis", "seconds"})
    EXPECT_EQ(rows[name].size(), 35u) << name;
  EXPECT_EQ(document["data"]["features"]["id"].size(), 8u);
  EXPECT_TRUE(std::filesystem::exists(path("out/trajectory.tum")));
  EXPECT_TRUE(read_file(path("out/map.ply")).starts_with("ply\n"));
  const Csv map = Csv::read(path("out/map.csv"));
  for (const char* name : {"point_id", "x_m", "y_m", "z_m", "sigma_m"}) EXPECT_TRUE(map.has(name)) << name;
  const Csv poses = Csv::read(path("out/poses.csv"));
  EXPECT_EQ(poses.num_rows(), 35u);
  for (std::size_t row = 0; row < 35; ++row) EXPECT_GT(poses.number(row, "cov_x_x"), 0.0);
  // What was written is read again, as a truth: the same path.
  const Outcome again = localize({"--landmarks", path("sim/target.yaml"), "--start", path("sim/start.yaml"), "--truth",
                                  path("out/trajectory.tum"), "--json"});
  ASSERT_EQ(again.code, 0) << again.err;
  EXPECT_LT(Json::parse(again.out)["estimate"]["ate_m"], 1e-6);
}

TEST_F(LocalizeCommand, LessOfTheLensIsWorseAndOnlineCalibrationFindsIt) {
  simulate({"--points", "20", "--frames", "60"});
  const auto error_of = [&](const std::vector<std::string>& options) {
    const Outcome outcome = localize(given(options));
    EXPECT_TRUE(outcome.code == 0 || outcome.code == 5 || outcome.code == 6) << outcome.err;  // 6: not to be trusted
    return Json::parse(outcome.out)["estimate"]["unaligned_m"].get<double>();
  };
  const double full = error_of({}), first = error_of({"--distortion", "radial1"}),
               none = error_of({"--distortion", "none"});
  EXPECT_GT(none, 2.0 * full);
  EXPECT_GT(none, first);
  EXPECT_LT(error_of({"--distortion", "radial1", "--calibrate-online"}), first);
  EXPECT_TRUE(std::filesystem::exists(path("out/camera.yaml")));
}

TEST_F(LocalizeCommand, SaysThatScaleIsUnknown) {
  simulate({"--points", "30", "--frames", "60", "--rate", "30"});
  const Outcome outcome = localize({"--truth", path("sim/truth.tum"), "--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["scale_known"], false);
  EXPECT_EQ(document["estimate"]["alignment"], "Sim(3)");
  EXPECT_EQ(document["verdict"]["state"], "care");
}

/// A target that is never seen gives no scale; one whose points are elsewhere is no target.
TEST_F(LocalizeCommand, ATargetThatIsNotThereIsSaid) {
  simulate();
  const std::string target = read_file(path("sim/target.yaml"));
  const auto with_ids = [&](const std::map<char, std::string>& names) {
    std::string text = target;
    for (std::size_t at = text.find("id: "); at != std::string::npos; at = text.find("id: ", at + 4))
      if (const auto name = names.find(text[at + 4]); name != names.end()) text.replace(at + 4, 1, name->second);
    write_file(path("sim/target.yaml"), text);
  };
  with_ids({{'2', "102"}, {'4', "104"}, {'6', "106"}, {'8', "108"}});
  const Outcome unseen = localize(given());
  ASSERT_EQ(unseen.code, 0) << unseen.err;
  const Json document = Json::parse(unseen.out);
  EXPECT_EQ(document["verdict"]["state"], "care");
  EXPECT_THAT(document["verdict"]["sentence"].get<std::string>(),
              ::testing::HasSubstr("none of the target's points is seen"));
  EXPECT_EQ(document["estimate"]["scale_known"], false);
  EXPECT_EQ(document["data"]["features"]["id"].size(), 8u);
  with_ids({{'2', "4"}, {'4', "6"}, {'6', "8"}, {'8', "2"}});
  const Outcome elsewhere = localize(given());
  EXPECT_EQ(elsewhere.code, 5) << elsewhere.out;
  EXPECT_THAT(elsewhere.err, ::testing::HasSubstr("the target is not where it is given"));
}

TEST_F(LocalizeCommand, WhatIsGivenWithoutSigmaIsSaid) {
  simulate({"--points", "30", "--frames", "60", "--rate", "30"});
  const auto verdict_with = [&](const std::vector<std::string>& options) {
    const Outcome outcome = localize(given(options));
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out);
  };
  const Json exact = verdict_with({});
  EXPECT_EQ(exact["verdict"]["state"], "good") << exact["verdict"]["sentence"];
  EXPECT_EQ(exact["assumed"][0]["sigma"], 0.0);  // the simulator's camera file has a covariance: zero
  std::string camera = read_file(path("sim/camera.yaml"));
  camera.erase(camera.find("covariance:"));
  write_file(path("sim/camera.yaml"), camera);
  const Json unknown = verdict_with({});
  EXPECT_TRUE(unknown["assumed"][0]["sigma"].is_null());
  double most = 0.0;
  for (const Json& each : unknown["assumed"])
    if (each["sigma"].is_null()) most = std::max(most, each["moves"].get<double>());
  EXPECT_GT(most, 0.0);
  EXPECT_EQ(unknown["verdict"]["state"] == "good", most <= 1.0);
}

/// Nothing but the side from which a flat target is seen tells that it, or the images, are mirrored.
TEST_F(LocalizeCommand, AMirroredTargetIsAskedAbout) {
  simulate({"--points", "30", "--frames", "60", "--rate", "30"});
  std::vector<KnownPoint> points = read_target(path("sim/target.yaml")).points;
  for (KnownPoint& point : points) point.point_in_world.x() *= -1.0;
  write_file(path("mirrored.yaml"), target_text(points));
  const Outcome asked = localize({"--target", path("mirrored.yaml"), "--json"});
  EXPECT_NE(Json::parse(asked.out)["verdict"]["state"], "good");
  EXPECT_THAT(asked.out, ::testing::HasSubstr("are they, or the images, mirrored?"));
  write_file(path("mirrored.yaml"), target_text(points) + "seen_from: +z\n");
  const Outcome meant = localize({"--target", path("mirrored.yaml"), "--json"});
  EXPECT_EQ(meant.out.find("mirrored?"), std::string::npos) << meant.out;
}

TEST_F(LocalizeCommand, RefusesWhatCannotBeDetermined) {
  simulate();
  const std::string header = "frame,t_s,point_id,u_px,v_px\n";
  const auto refused_as = [&](const std::string& table, const std::vector<std::string>& options,
                              const std::string& what) {
    write_file(path("some.csv"), table);
    const Outcome outcome = localize(options, "some.csv");
    EXPECT_EQ(outcome.code, 4) << what << outcome.out << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out/trajectory.tum")));
    EXPECT_TRUE(std::filesystem::exists(path("out/result.json")));
  };
  refused_as(header + "0,0,2,400,300\n1,0.1,2,401,300\n", {"--target", path("sim/target.yaml")}, "too few points");
  refused_as(header + "0,0,1,400,300\n0,0,3,450,300\n0,0,5,470,350\n", {"--target", path("sim/target.yaml")},
             "target is not found");
}

TEST_F(LocalizeCommand, SaysWhatIsWrongWithItsInput) {
  simulate();
  const std::string header = "frame,t_s,point_id,u_px,v_px\n";
  const auto expect = [&](const std::string& table, const std::string& what) {
    write_file(path("bad.csv"), table);
    const Outcome outcome = localize({}, "bad.csv");
    EXPECT_EQ(outcome.code, 3) << table << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  expect("", "bad.csv");
  expect(header, "has no observations");
  expect("frame,point_id,u_px,v_px\n0,1,1,1\n", "has no column 't_s'; give it, or --rate");
  expect(header + "0,0,1,nan,1\n", "bad.csv:2: column 'u_px': 'nan' is not a finite number");
  expect(header + "0,0,1,1e300,1\n", "column 'u_px'");
  expect(header + "0,0,1,5000,1\n", "far outside the camera's 768 px");
  expect(header + "0,0,1,100,2000\n", "far outside the camera's 576 px");
  expect(header + "0,0,1,1,1\n1,0,1,1,1\n", "is not after frame 0");
  expect(header + "1,0.1,1,1,1\n0,0.2,1,1,1\n", "runs backwards");
  expect(header + "0,0,1,1,1\n0,0.1,2,1,1\n", "differs from the first row of frame 0");
  expect(header + "0,0,1,1,1\n0,0,1,2,2\n", "1 appears twice in frame 0");
  expect(header + "0,0,-3,1,1\n", "column 'point_id'");
  for (const auto& [option, value] : {std::pair("--distortion", "some"), {"--sigma-px", "0"}, {"--rate", "nan"}})
    EXPECT_EQ(localize({option, value}).code, 2);
  const auto bad_file = [&](const char* option, const std::string& text, const std::string& what) {
    write_file(path("bad.yaml"), text);
    const Outcome outcome = localize({option, path("bad.yaml")});
    EXPECT_EQ(outcome.code, 3) << text << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
  };
  bad_file("--target", "points: []\n", "has no points");
  bad_file("--target", "points: [{id: 1, x_m: 0, y_m: 0, z_m: 0}, {id: 1, x_m: 1, y_m: 0, z_m: 0}]\n", "appears twice");
  bad_file("--target", "points: [{id: 1, x_m: .nan, y_m: 0, z_m: 0}]\n", "x_m");
  bad_file("--target", "rectangle: {width_m: 1, height_m: 1}\n", "is found in images");
  bad_file("--target", "points: [{id: 1, x_m: 0, y_m: 0, z_m: 0}]\nseen_from: above\n", "is not +z or -z");
  bad_file("--target", "board: {corners: 3x3, square_m: 1}\nseen_from: +z\n", "is of points");
  bad_file("--start", "position_m: [0, 0, 0]\nquaternion_wxyz: [2, 0, 0, 0]\n", "has the length 2, not 1");
  const std::string start = "position_m: [0, 0, 0]\nquaternion_wxyz: [1, 0, 0, 0]\n";
  bad_file("--start", start + "sigma_rate_rad_s: -1\n", "is not above zero");
  bad_file("--start", start + "depths: [{id: 4, depth_m: 1}, {id: 4, depth_m: 2}]\n", "4 appears twice");
  bad_file("--truth", "0 1 2 3\n", "is not 't x y z qx qy qz qw'");
}

TEST_F(LocalizeCommand, ASensorsFileIsReadByTheSameRulesAndOutOfTimeIsNamed) {
  simulate();
  const std::string header = "t_s,depth_m\n";
  EXPECT_EQ(localize(given({"--depth-arm", "0,0,1"})).code, 2);
  write_file(path("depth.csv"), header + "0,1\nnan,1\n0.2,1\n0.1,1\n0.3,1\n");
  const Outcome stopped = localize(given({"--depth-sensor", path("depth.csv")}));
  EXPECT_EQ(stopped.code, 3);
  EXPECT_NE(stopped.err.find("depth.csv:3"), std::string::npos) << stopped.err;
  const Outcome skipped = localize(given({"--depth-sensor", path("depth.csv"), "--skip-bad"}));
  EXPECT_EQ(skipped.code, 0) << skipped.err;
  EXPECT_EQ(Json::parse(skipped.out)["counts"]["skipped"].size(), 2u);
  write_file(path("depth.csv"), header + "1000,1\n1001,2\n");
  const Outcome late = localize(given({"--depth-sensor", path("depth.csv")}));
  EXPECT_NE(late.out.find("none of them is of the time of the path"), std::string::npos) << late.out;
}

TEST_F(LocalizeCommand, QuaternionsBeginWithTheirRealPartButInTum) {
  simulate();
  ASSERT_EQ(localize(given()).code, 0);
  EXPECT_TRUE(read_file(path("out/poses.csv")).starts_with("frame,t_s,x_m,y_m,z_m,qw,qx,qy,qz,"));
  const Csv poses = Csv::read(path("out/poses.csv"));
  const std::vector<TimedPose> path_of = read_tum(path("out/trajectory.tum"));
  ASSERT_EQ(path_of.size(), poses.num_rows());
  for (std::size_t k = 0; k < path_of.size(); ++k) {
    const Eigen::Quaterniond& q = path_of[k].world_from_cam.rotation;
    EXPECT_NEAR(poses.number(k, "qw"), q.w(), 1e-8);
    EXPECT_NEAR(poses.number(k, "qx"), q.x(), 1e-8);
  }
}

TEST_F(LocalizeCommand, FollowsABoardInImagesTakenUnderWater) {
  simulate({"--video", "--frames", "12", "--rate", "30"});
  const Outcome outcome = alidade({"localize", path("sim/frames"), "--rate", "30", "--camera", path("sim/camera.yaml"),
                                   "--target", path("sim/target.yaml"), "--truth", path("sim/truth.tum"), "--json",
                                   "--out", path("out"), "--no-report"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"];
  EXPECT_EQ(estimate["frames"], 12);
  EXPECT_EQ(estimate["lost"], 0);
  EXPECT_LT(estimate["ate_m"], 0.003);  // a tenth of a pixel at 0.6 m is 0.08 mm; the filter believes half a pixel
  const Outcome mixed = alidade({"simulate", "underwater", "--video", "--points", "9", "--out", path("none")});
  EXPECT_EQ(mixed.code, 2);
  EXPECT_FALSE(std::filesystem::exists(path("none")));
}

/// Also where rows of frames are missing, and frames are not evenly apart.
TEST_F(LocalizeCommand, AnswersRowsFromStandardInputAsTheFileIsAnswered) {
  simulate({"--points", "20", "--frames", "40"});
  const Csv csv = Csv::read(path("sim/sights.csv"));
  std::string text = "frame,t_s,point_id,u_px,v_px\n";
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const long frame = csv.integer(row, "frame", 0, 1000);
    if (frame == 1 || frame == 2 || frame % 11 == 5) continue;
    const double t_s = csv.number(row, "t_s") + (frame > 20 ? 0.35 : 0.0);
    text += csv.text(row, "frame") + "," + std::to_string(t_s) + "," + csv.text(row, "point_id") + "," +
            csv.text(row, "u_px") + "," + csv.text(row, "v_px") + "\n";
  }
  write_file(path("rows.csv"), text);
  const std::vector<std::string> target{"--target", path("sim/target.yaml"), "--start", path("sim/start.yaml")};
  ASSERT_EQ(localize(target, "rows.csv").code, 0);
  const std::string line = std::string("'") + ALIDADE_EXECUTABLE + "' localize - --no-report --camera '" +
                           path("sim/camera.yaml") + "' --target '" + path("sim/target.yaml") + "' --start '" +
                           path("sim/start.yaml") + "' --out '" + path("live") + "'";
  const Outcome live = testing::run_program({"sh", "-c", line + " < '" + path("rows.csv") + "'"});
  EXPECT_EQ(live.code, 0) << live.err;
  for (const char* file : {"poses.csv", "map.csv", "trajectory.tum"})
    EXPECT_EQ(read_file(path(std::string("live/") + file)), read_file(path(std::string("out/") + file))) << file;
  const std::string whole = read_file(path("out/poses.csv"));
  EXPECT_EQ(live.out.substr(0, whole.find('\n')), whole.substr(0, whole.find('\n')));
  EXPECT_GT(std::ranges::count(live.out, '\n'), std::ranges::count(whole, '\n'));

  const Outcome empty = testing::run_program({"sh", "-c", "head -1 '" + path("rows.csv") + "' | " + line});
  EXPECT_EQ(empty.code, 3);
  EXPECT_THAT(empty.err, ::testing::HasSubstr("-: has no observations"));
  const Outcome cut = testing::run_program({"sh", "-c", "(head -5 '" + path("rows.csv") + "'; echo 0,0,x) | " + line});
  EXPECT_EQ(cut.code, 3);
  EXPECT_THAT(cut.err, ::testing::HasSubstr("-:6: has 3 cells"));
  const Outcome skipped = testing::run_program(
      {"sh", "-c", "(cat '" + path("rows.csv") + "'; echo 0,0,1,1,1) | " + line + " --skip-bad --json"});
  EXPECT_EQ(skipped.code, 0) << skipped.err;
  EXPECT_EQ(Json::parse(skipped.out)["counts"]["skipped"].size(), 1u);
}

/// A frame is answered as soon as the next one starts, while its sender continues.
TEST_F(LocalizeCommand, AnswersWhileRowsStillCome) {
  simulate({"--points", "20", "--frames", "10"});
  const std::string answers = path("answers.csv");
  const std::string line = "(cat '" + path("sim/sights.csv") + "'; i=0; while [ $(wc -l < '" + answers +
                           "') -lt 10 ] && [ $i -lt 600 ]; do sleep 0.05; i=$((i+1)); done; echo $i >&2) | '" +
                           ALIDADE_EXECUTABLE + "' localize - --no-report --camera '" + path("sim/camera.yaml") +
                           "' --target '" + path("sim/target.yaml") + "' --out '" + path("live") + "' > '" + answers +
                           "'";
  write_file(answers, "");
  const Outcome live = testing::run_program({"sh", "-c", line});
  EXPECT_EQ(live.code, 0) << live.err;
  EXPECT_LT(std::stoi(live.err), 600);  // the header and nine frames of ten were there before the input ended
}

/// What the rows of a wrong lens are, while they come; of the right one nothing is said.
TEST_F(LocalizeCommand, SaysOfItsRowsWhatTheFilterSees) {
  for (const char* focal : {"1", "1.05"}) {
    simulate({"--points", "40", "--frames", "301", "--rate", "30", "--told-f", focal});
    const std::string line = std::string("'") + ALIDADE_EXECUTABLE + "' localize - --no-report --camera '" +
                             path("sim/camera.yaml") + "' --out '" + path("live") + "' < '" + path("sim/sights.csv") +
                             "' --target '" + path("sim/target.yaml") + "'";
    const Outcome live = testing::run_program({"sh", "-c", line});
    EXPECT_EQ(live.code, 0) << live.err;
    const bool is_right = std::string(focal) == "1";
    EXPECT_EQ(live.err.find("rows to frame 299, by the filter alone: ") == std::string::npos, is_right) << live.err;
  }
  const Outcome free = testing::run_program(
      {"sh", "-c",
       std::string("'") + ALIDADE_EXECUTABLE + "' localize - --no-report --quiet --camera '" + path("sim/camera.yaml") +
           "' --out '" + path("live") + "' < '" + path("sim/sights.csv") + "'"});
  EXPECT_THAT(free.err, ::testing::HasSubstr("rows are up to scale"));
}

TEST_F(LocalizeCommand, SurvivesMissingFramesAndUnknownPoints) {
  simulate({"--points", "20", "--frames", "60"});
  const Csv csv = Csv::read(path("sim/sights.csv"));
  std::string text = "frame,t_s,point_id,u_px,v_px\n";
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    const long frame = csv.integer(row, "frame", 0, 1000);
    if (frame % 7 == 3 || (frame > 30 && frame < 36)) continue;
    text += csv.text(row, "frame") + "," + csv.text(row, "t_s") + "," + csv.text(row, "point_id") + "," +
            csv.text(row, "u_px") + "," + csv.text(row, "v_px") + "\n";
    if (frame % 5 == 0 && csv.text(row, "point_id") == "1")  // a point that is seen once
      text += csv.text(row, "frame") + "," + csv.text(row, "t_s") + "," + std::to_string(1000 + frame) + ",100,100\n";
  }
  write_file(path("gaps.csv"), text);
  const Outcome outcome = localize(given(), "gaps.csv");
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["frames"], 59);  // the last one is among the missing
  EXPECT_GE(document["estimate"]["lost"], 12);
  EXPECT_NE(document["verdict"]["state"], "good");
  const Outcome skipped = localize(given({"--skip-bad"}), "gaps.csv");
  EXPECT_EQ(skipped.code, 0) << skipped.err;
}

/// The map of one run is the start of the next one, in its frame and scale, without the target.
TEST_F(LocalizeCommand, BeginsInTheMapOfAnEarlierRun) {
  simulate({"--points", "30", "--frames", "60", "--rate", "30"});
  ASSERT_EQ(localize(given()).code, 0);
  const std::string map = path("map.yaml");
  std::filesystem::copy_file(path("out/map.yaml"), map);
  const std::vector<std::string> in_map{"--map", map, "--truth", path("sim/truth.tum"), "--json"};
  const Outcome outcome = localize(in_map);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["lost"], 0);
  EXPECT_EQ(document["estimate"]["scale_known"], true);
  EXPECT_LT(document["estimate"]["unaligned_m"].get<double>(), 0.02);
  EXPECT_THAT(document["verdict"]["checks"].dump(), ::testing::HasSubstr("scale and frame are those of the map"));
  const Outcome both = localize({"--map", map, "--target", path("sim/target.yaml")});
  EXPECT_EQ(both.code, 2);
  EXPECT_THAT(both.err, ::testing::HasSubstr("give one of them"));
  write_file(map, "points: 3\n");
  EXPECT_EQ(localize(in_map).code, 3);
}

TEST_F(LocalizeCommand, AnImuGivesMetresWithoutATarget) {
  simulate({"--frames", "240", "--points", "40", "--rate", "30", "--imu", "200"});
  const std::vector<std::string> imu{"--imu",   path("sim/imu.csv"),   "--imu-mounting", path("sim/imu.yaml"),
                                     "--truth", path("sim/truth.tum"), "--json"};
  const Outcome outcome = localize(imu);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["scale_known"], true);
  EXPECT_EQ(document["estimate"]["imu"]["used"], true);
  EXPECT_EQ(document["estimate"]["imu"]["gravity_in_world_m_s2"].size(), 3u);
  EXPECT_GT(document["stddev"]["imu"]["scale"], 0.0);
  EXPECT_EQ(document["estimate"]["alignment"], "SE(3)");
  EXPECT_LT(document["estimate"]["ate_m"], 0.01);
  EXPECT_EQ(localize({"--imu-mounting", path("sim/imu.yaml")}).code, 2);
  EXPECT_EQ(localize({"--imu", path("sim/target.yaml")}).code, 3);
}

}  // namespace
}  // namespace alidade
