#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/formats/rig_file.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;
constexpr double degree = 0.017453292519943295;

class RigCommand : public testing::CommandTest {
 protected:
  void simulate(const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments{"simulate", "rig", "--out", path("sim"), "--quiet", "--no-report"};
    const Outcome made = alidade(arguments, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  [[nodiscard]] Outcome calibrate(const std::string& views, const std::vector<std::string>& options = {}) const {
    std::vector<std::string> arguments{"rig",         views,   "--camera", path("sim/camera_1.yaml"),
                                       "--board",     "9x6",   "--square", "0.025",
                                       "--no-report", "--out", path("out")};
    return alidade(arguments, options);
  }
};

/// RMS over both heads' angles of the second camera in the first.
void expect_near_truth(const Rig& rig, const Rig& truth, double max_deg, double max_m) {
  double angle2 = 0.0, length2 = 0.0, num = 0.0;
  for (const double pan : {-0.5, 0.0, 0.5}) {
    for (const double tilt : {-0.2, 0.1, 0.4}) {
      const auto cam_from_cam = [&](const Rig& of) {
        return cam_from_world(of.heads[0].head, {pan, tilt}) * world_from_cam(of.heads[1].head, {-pan, tilt});
      };
      const Rigid3 a = cam_from_cam(rig), b = cam_from_cam(truth);
      angle2 += std::pow(a.rotation.angularDistance(b.rotation) / degree, 2);
      length2 += (a.translation - b.translation).squaredNorm();
      num += 1.0;
    }
  }
  EXPECT_LT(std::sqrt(angle2 / num), max_deg);
  EXPECT_LT(std::sqrt(length2 / num), max_m);
}

TEST_F(RigCommand, GivesTheRigWithTheNamesOfTheContract) {
  simulate();
  // The simulated encoders' scales are exact; where that is not given they are estimated, and errors are twice as
  // large.
  const Outcome outcome = calibrate(path("sim/views.csv"), {"--json", "--sigma-scale", "1e-5"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["estimate"]["heads"].size(), 2u);
  EXPECT_EQ(document["stddev"]["heads"].size(), 2u);
  EXPECT_NEAR(document["estimate"]["chi2_per_dof"], 1.0, 0.1);
  EXPECT_NEAR(document["estimate"]["rms_px"], 0.2 * std::sqrt(2.0), 0.02);  // per point
  EXPECT_EQ(document["counts"]["used"], document["counts"]["given"]);
  EXPECT_EQ(document["data"]["views"]["used"].size(), document["counts"]["given"].get<std::size_t>());
  const Rig rig = read_rig(path("out/rig.yaml"));
  expect_near_truth(rig, read_rig(path("sim/truth_rig.yaml")), 0.20, 0.0035);
  EXPECT_EQ(rig.cov.rows(), 2 * num_head_params);
}

TEST_F(RigCommand, SaysWhatItAssumedAndHeedsIt) {
  simulate();
  const std::string lens = "model: pinhole\nwidth: 320\nheight: 240\nfx: 337.84\nfy: 337.84\ncx: 160\ncy: 120\n";
  write_file(path("sim/camera_1.yaml"), lens);
  const Json document = Json::parse(calibrate(path("sim/views.csv"), {"--json", "--estimate", "none"}).out);
  EXPECT_EQ(document["verdict"]["state"], "care");
  std::vector<std::string> names;
  for (const Json& what : document["assumed"]) {
    names.push_back(what["name"]);
    EXPECT_TRUE(what["sigma"].is_null());
    EXPECT_GT(what["moves"].get<double>(), 0.0);
  }
  for (const std::string name : {"camera.fx", "camera.cx", "square_m", "head1.pan_scale", "head2.tilt_scale"})
    EXPECT_EQ(std::ranges::count(names, name), 1) << name;
  EXPECT_EQ(document["stddev_model"]["heads"].size(), 2u);
  EXPECT_EQ(document["data"]["views"]["cluster_z2"].size(), document["counts"]["given"].get<std::size_t>());
  // Everything given, the lens's σ in its file: good.
  write_file(path("sim/camera_1.yaml"),
             lens + "covariance: {names: [fx, fy, cx, cy], upper: [1e-6, 0, 0, 0, 1e-6, 0, 0, 1e-6, 0, 1e-6]}\n");
  const Json given =
      Json::parse(calibrate(path("sim/views.csv"), {"--json", "--sigma-square", "1e-6", "--sigma-scale", "1e-5"}).out);
  EXPECT_EQ(given["verdict"]["state"], "good") << given["verdict"]["sentence"];
  for (const Json& what : given["assumed"]) EXPECT_FALSE(what["sigma"].is_null()) << what["name"];
}

/// Where the encoders' scales are not given they are estimated; other causes in the residuals are named, and kept in
/// rig.yaml.
TEST_F(RigCommand, EstimatesWhatIsAskedFor) {
  simulate({"--scale", "1.01", "--once-deg", "3"});
  const Outcome outcome = calibrate(path("sim/views.csv"), {"--json", "--sigma-square", "1e-6"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  EXPECT_EQ(document["verdict"]["state"], "care");
  EXPECT_FALSE(document["estimate"]["estimated"].empty());
  const Rig rig = read_rig(path("out/rig.yaml"));
  expect_near_truth(rig, read_rig(path("sim/truth_rig.yaml")), 1.0, 0.02);
  EXPECT_EQ(calibrate(path("sim/views.csv"), {"--estimate", "auto,scale"}).code, 2);
  EXPECT_EQ(calibrate(path("sim/views.csv"), {"--estimate", "scale", "--sigma-scale", "0.001"}).code, 2);
  simulate({"--swap-angles"});
  const Outcome exchanged = calibrate(path("sim/views.csv"));
  EXPECT_EQ(exchanged.code, 4);
  EXPECT_NE(exchanged.err.find("pan and tilt are exchanged"), std::string::npos) << exchanged.err;
}

/// What is typed beats the file, and what is in neither is the default.
TEST_F(RigCommand, OptionsMayStandInAFile) {
  simulate();
  const Json typed =
      Json::parse(calibrate(path("sim/views.csv"), {"--json", "--sigma-px", "0.2", "--estimate", "scale,focal"}).out);
  write_file(path("rig.yaml"),
             "board: 9x6\nsquare_m: 0.025\nsigma_px: 0.7\nestimate: [scale, focal]\noutliers: drop\n");
  const auto with_file = [&](const std::vector<std::string>& options) {
    return alidade({"rig", path("sim/views.csv"), "--camera", path("sim/camera_1.yaml"), "--config", path("rig.yaml"),
                    "--json", "--no-report", "--out", path("out")},
                   options);
  };
  const Json from_file = Json::parse(with_file({"--sigma-px", "0.2"}).out);
  EXPECT_EQ(from_file["estimate"], typed["estimate"]);
  EXPECT_NE(Json::parse(with_file({}).out)["estimate"], typed["estimate"]);
  write_file(path("rig.yaml"),
             "board: 9x6\nsquare_m: 0.025\nno-report: true\nquiet: true\nthreads: 1\nout: " + path("elsewhere") + "\n");
  const Outcome common =
      alidade({"rig", path("sim/views.csv"), "--camera", path("sim/camera_1.yaml"), "--config", path("rig.yaml")}, {});
  EXPECT_EQ(common.code, 0) << common.err;
  EXPECT_EQ(common.out, "") << "quiet";
  EXPECT_TRUE(std::filesystem::exists(path("elsewhere/result.json")));
  EXPECT_FALSE(std::filesystem::exists(path("elsewhere/report.html")));
  write_file(path("rig.yaml"), "board: 9x6\nsquare_m: 0.025\nestimate: [auto, scale]\n");
  EXPECT_THAT(with_file({}).err, ::testing::HasSubstr("'auto' excludes the others"));
  EXPECT_EQ(calibrate(path("sim/views.csv"), {"--clocks", "3"}).code, 2);
  EXPECT_EQ(calibrate(path("sim/views.csv"), {"--scales", "--sigma-scale", "0.1"}).code, 2);
}

TEST_F(RigCommand, FromRenderedPhotosEndToEnd) {
  simulate({"--photos"});
  const Outcome outcome = calibrate(path("sim/views.csv"), {"--sigma-scale", "1e-5"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  expect_near_truth(read_rig(path("out/rig.yaml")), read_rig(path("sim/truth_rig.yaml")), 0.20, 0.0035);
  const Outcome squares = alidade({"rig", path("sim/views.csv"), "--camera", path("sim/camera_1.yaml"), "--board",
                                   "10x7", "--square", "0.025", "--no-report", "--out", path("squares")});
  EXPECT_EQ(squares.code, 4) << squares.out;
  EXPECT_THAT(squares.err, ::testing::HasSubstr("use --board 9x6: they show that board"));
}

/// Two heads 0.5 m apart look straight ahead at a point 2 m away, half way between them: by hand.
TEST_F(RigCommand, ProjectCountsTheErrorsOfHeadsAndLenses) {
  const std::string camera = "{model: pinhole, width: 320, height: 240, fx: 400, fy: 400, cx: 160, cy: 120";
  const auto heads = [&](const std::string& more) {
    return "heads: [{id: 1, camera: " + camera + more + "}}, {id: 2, camera: " + camera + more +
           "}, world_from_base: {translation_m: [0.5, 0, 0]}}]\n";
  };
  const auto projected = [&](const std::string& rig) {
    write_file(path("rig.yaml"), rig);
    const Outcome outcome = alidade({"project", "--rig", path("rig.yaml"), "--pan", "0", "--tilt", "0", "--point",
                                     "0.25", "0", "2", "--json", "--no-report", "--out", path("p")});
    EXPECT_EQ(outcome.code, 0) << outcome.err;
    return Json::parse(outcome.out);
  };
  const Json none = projected(heads(""));
  EXPECT_EQ(none["verdict"]["state"], "care");
  EXPECT_THAT(none["verdict"]["sentence"].get<std::string>(), ::testing::HasSubstr("without covariance"));
  // σ of 2 px in cx of the first lens, 0.001 rad in yaw of the second head.
  const Json given = projected(heads(", covariance: {names: [cx], upper: [4]}") +
                               "covariance: {names: [head2.base_ry_rad], upper: [1e-6]}\n");
  EXPECT_EQ(given["verdict"]["state"], "good");
  EXPECT_NEAR(given["estimate"]["heads"][0]["sigma_px"][0], 2.0, 1e-3);
  // The second sees it 0.125 to the left: du = f (1 + 0.125²) dφ.
  EXPECT_NEAR(given["estimate"]["heads"][1]["sigma_px"][0], std::hypot(2.0, 400.0 * 1.015625 * 0.001), 1e-3);
  // Range: z = B f / (u1 − u2): σ_z = z²/(B f) σ(u1 − u2).
  const double sigma_px = std::sqrt(4.0 + 4.0 + std::pow(0.40625, 2));
  EXPECT_NEAR(given["stddev"]["point_in_world_m"][2], 4.0 / (0.5 * 400.0) * sigma_px, 2e-4);
}

TEST_F(RigCommand, ProjectPrintsMatricesAndPixels) {
  simulate();
  const std::vector<std::string> command{"project",     "--rig",    path("sim/truth_rig.yaml"),
                                         "--pan",       "0.1,-0.2", "--tilt",
                                         "0.2",         "--point",  "0.2",
                                         "-0.3",        "1.5",      "--json",
                                         "--no-report", "--out",    path("p")};
  const Outcome outcome = alidade(command);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"];
  int num_checked = 0;
  for (const std::string name : {"M1", "M2"}) {
    // The lens has no distortion: the matrix alone gives the pixel.
    Eigen::Vector3d uvw;
    for (std::size_t i = 0; i < 3; ++i) {
      const Json& row = estimate[name][i];
      uvw[static_cast<int>(i)] =
          0.2 * row[0].get<double>() - 0.3 * row[1].get<double>() + 1.5 * row[2].get<double>() + row[3].get<double>();
    }
    const Json& px = estimate["heads"][name == "M1" ? 0 : 1]["px"];
    EXPECT_NEAR(px[0], uvw.x() / uvw.z(), 1e-9);
    EXPECT_NEAR(px[1], uvw.y() / uvw.z(), 1e-9);
    ++num_checked;
  }
  EXPECT_EQ(num_checked, 2);
  // By hand: two paper heads, pan 0.1 rad: M1 = K [R_y | 0].
  write_file(path("rig.yaml"),
             "heads: [{camera: {model: pinhole, width: 320, height: 240, fx: 100, fy: 100, cx: 160, cy: 120}}]\n");
  const Outcome plain = alidade({"project", "--rig", path("rig.yaml"), "--pan", "0.1", "--tilt", "0", "--json",
                                 "--no-report", "--out", path("p")});
  ASSERT_EQ(plain.code, 0) << plain.err;
  const Json M = Json::parse(plain.out)["estimate"]["M1"];
  EXPECT_NEAR(M[0][0], 100.0 * std::cos(0.1) - 160.0 * std::sin(0.1), 1e-12);
  EXPECT_NEAR(M[0][2], 100.0 * std::sin(0.1) + 160.0 * std::cos(0.1), 1e-12);
  EXPECT_NEAR(M[1][1], 100.0, 1e-12);
}

TEST_F(RigCommand, WhatCannotBeDeterminedIsRefusedByName) {
  for (const auto& [scenario, words] : std::vector<std::array<std::string, 2>>{
           {"pan_only", "pan only: its tilt axis cannot be determined; tilt the head"},
           {"tilt_only", "tilt only: its pan axis cannot be determined; pan the head"},
           {"unlinked", "shares no board with another head"}}) {
    simulate({"--scenario", scenario});
    const Outcome outcome = calibrate(path("sim/views.csv"));
    EXPECT_EQ(outcome.code, 4) << scenario << outcome.err;
    EXPECT_NE(outcome.err.find(words), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out/rig.yaml")));
    EXPECT_TRUE(std::filesystem::exists(path("out/result.json")));
  }
}

TEST_F(RigCommand, OneHeadAndWrongViewsAreNoTrouble) {
  simulate({"--scenario", "one_head"});
  EXPECT_EQ(calibrate(path("sim/views.csv")).code, 0);
  simulate({"--wrong", "0.1"});
  const Json made = Json::parse(read_file(path("sim/result.json")));
  const Outcome outcome = calibrate(path("sim/views.csv"), {"--json"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json views = Json::parse(outcome.out)["data"]["views"];
  int num_wrong = 0;
  for (std::size_t i = 0; i < views["name"].size(); ++i) {
    const bool is_wrong = std::ranges::count(made["estimate"]["wrong_views"], views["name"][i]) > 0;
    EXPECT_EQ(views["used"][i].get<bool>(), !is_wrong) << views["name"][i] << views["reason"][i];
    num_wrong += is_wrong ? 1 : 0;
  }
  EXPECT_GE(num_wrong, 3);
}

TEST_F(RigCommand, WrongCornersAreLeftOutAndNamed) {
  simulate({"--wrong-corners", "0.01"});
  const Outcome outcome = calibrate(path("sim/views.csv"));
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  EXPECT_THAT(outcome.out, ::testing::ContainsRegex("rejected: view [0-9]+: corner [0-9]+ is [0-9]+ px from where"));
  EXPECT_THAT(outcome.out, ::testing::HasSubstr("55 of 55 views"));
  expect_near_truth(read_rig(path("out/rig.yaml")), read_rig(path("sim/truth_rig.yaml")), 0.40, 0.007);
}

TEST_F(RigCommand, SaysWhatIsWrongWithItsInput) {
  simulate();
  int num_checked = 0;
  const auto expect = [&](const std::string& table, const std::string& what) {
    write_file(path("views.csv"), table);
    const Outcome outcome = calibrate(path("views.csv"));
    EXPECT_EQ(outcome.code, 3) << table << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
    ++num_checked;
  };
  const std::string header = "view,board,head,pan_rad,tilt_rad,corner,u,v\n";
  expect("", "views.csv");
  expect(header, "has no views");
  expect("view,board,head,pan_deg,tilt_px,corner,u,v\n0,0,1,10,10,0,1,1\n", "has no column 'tilt_rad'");
  expect("view,board,head,pan_deg,tilt_deg,corner,u,v\n0,0,1,400,10,0,1,1\n",
         "views.csv:2: column 'pan_deg': '400' is more than a turn");
  expect("view,board,pan_rad,tilt_rad,corner,u,v\n", "has no column 'head'");
  expect("view,board,head,pan_rad,tilt_rad\n0,0,1,0,0\n", "has no column 'corner'");
  expect(header + "0,0,1,45,0,0,1,1\n", "views.csv:2: column 'pan_rad': '45' is more than a turn; angles are radians");
  expect(header + "0,0,1,0,nan,0,1,1\n", "views.csv:2: column 'tilt_rad': 'nan' is not a finite number");
  expect(header + "0,0,1,0,0,54,1,1\n", "views.csv:2: column 'corner': '54' is not a corner of a board of 54");
  expect(header + "0,0,1,0,0,3,1,1\n0,0,1,0,0,3,1,1\n", "views.csv:3: column 'corner': 3 appears twice in view 0");
  expect(header + "0,0,1,0,0,3,1,1\n0,0,1,0.1,0,4,1,1\n",
         "views.csv:3: column 'pan_rad': '0.1' differs from the first");
  expect(header + "0,0,1,0,0,3,1,1\n0,0,2,0,0,4,1,1\n", "views.csv:3: column 'head': '2' differs from the first");
  expect(header + "0,0,1,0,0,3,1e300,1\n", "views.csv:2");
  expect("view,board,head,pan_rad,tilt_rad,photo\n0,0,1,0,0,none.png\n", "none.png");
  expect("view,board,head,pan_rad,tilt_rad,photo\n0,0,1,0,0,\n", "column 'photo': is empty");
  EXPECT_EQ(num_checked, 15);
}

TEST_F(RigCommand, WrongUsageAndBadFilesAreNamed) {
  simulate();
  EXPECT_EQ(alidade({"rig", path("sim/views.csv"), "--board", "9x6", "--square", "0.025"}).code, 2);  // no camera
  EXPECT_EQ(calibrate(path("sim/views.csv"), {"--sigma-px", "-1"}).code, 2);
  const std::string camera = path("sim/camera_1.yaml");
  const Outcome three = calibrate(path("sim/views.csv"), {"--camera", camera, "--camera", camera});
  EXPECT_EQ(three.code, 3);
  EXPECT_NE(three.err.find("has 2 heads (1, 2), but there are 3 cameras"), std::string::npos) << three.err;
  const std::string rig = path("sim/truth_rig.yaml");
  EXPECT_EQ(alidade({"project"}).code, 2);
  EXPECT_EQ(alidade({"project", "--rig", rig}).code, 2);
  EXPECT_EQ(alidade({"project", "--rig", rig, "--pan", "45", "--tilt", "0"}).code, 2);
  EXPECT_EQ(alidade({"project", "--rig", rig, "--pan", "0,0,0", "--tilt", "0"}).code, 2);
  EXPECT_EQ(alidade({"project", "--rig", rig, "--beam", "b.yaml", "--pan", "0", "--tilt", "0"}).code, 2);
  EXPECT_EQ(alidade({"project", "--rig", path("none.yaml"), "--pan", "0", "--tilt", "0"}).code, 3);
}

/// Head 1's rows again, as head 2's.
TEST_F(RigCommand, OneHeadGivenAsTwoIsRefused) {
  simulate({"--scenario", "one_head"});
  std::string table = read_file(path("sim/views.csv")), again;
  std::size_t at = table.find('\n') + 1;
  while (at < table.size()) {
    const std::size_t end = table.find('\n', at);
    std::string row = table.substr(at, end + 1 - at);
    const std::size_t head = row.find(',', row.find(',') + 1) + 1;
    ASSERT_EQ(row[head], '1') << row;
    row[head] = '2';
    again += "9" + std::string(5 - row.find(','), '0') + row;
    at = end + 1;
  }
  write_file(path("views.csv"), table + again);
  const Outcome outcome = calibrate(path("views.csv"));
  EXPECT_EQ(outcome.code, 3) << outcome.out;
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("digit for digit"));
  EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
}

}  // namespace
}  // namespace alidade
