#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class RangefinderCommand : public testing::CommandTest {
 protected:
  void simulate(const std::vector<std::string>& options = {}) {
    std::vector<std::string> arguments{"simulate", "rangefinder", "--out", path("sim"), "--quiet", "--no-report"};
    const Outcome made = alidade(arguments, options);
    ASSERT_EQ(made.code, 0) << made.err;
  }
  /// The simulated shots, with their corners.
  [[nodiscard]] Outcome calibrate(const std::vector<std::string>& options) const {
    std::vector<std::string> arguments{"rangefinder", path("sim/shots.csv"),
                                       "--camera",    path("sim/camera.yaml"),
                                       "--corners",   path("sim/corners.csv"),
                                       "--board",     "9x6",
                                       "--square",    "0.04",
                                       "--out",       path("out")};
    return alidade(arguments, options);
  }
  /// Of spots, planes or ranges in a table of one's own.
  [[nodiscard]] Outcome calibrate_table(const std::string& table, const std::vector<std::string>& options = {}) const {
    write_file(path("shots.csv"), table);
    std::vector<std::string> arguments{"rangefinder", path("shots.csv"), "--camera", path("sim/camera.yaml"),
                                       "--no-report", "--out",           path("out")};
    return alidade(arguments, options);
  }
};

void expect_near_truth(const Json& document, double sigmas = 3.5) {
  const std::vector<double> origin{0.04, -0.07, 0.04}, direction{0.013795889, -0.015203087, 0.999789248};
  for (std::size_t i = 0; i < 3; ++i) {
    const double sigma_m = document["stddev"]["origin_m"][i], sigma = document["stddev"]["direction"][i];
    EXPECT_NEAR(document["estimate"]["origin_m"][i], origin[i], sigmas * sigma_m);
    EXPECT_NEAR(document["estimate"]["direction"][i], direction[i], sigmas * sigma);
  }
}

/// The page is another way to read the result; without it the result was another.
TEST_F(RangefinderCommand, TheResultIsTheSameWithoutThePage) {
  simulate();
  const Json with = Json::parse(calibrate({"--json"}).out),
             without = Json::parse(calibrate({"--json", "--no-report"}).out);
  EXPECT_TRUE(without["grids"].contains("next_shot"));
  EXPECT_EQ(with["grids"], without["grids"]);
  EXPECT_EQ(with["estimate"], without["estimate"]);
}

TEST_F(RangefinderCommand, GivesTheBeamWithTheNamesOfTheContract) {
  simulate();
  for (const std::string method : {"joint", "spot", "plane"}) {
    const Outcome outcome = calibrate({"--method", method, "--json", "--no-report"});
    ASSERT_EQ(outcome.code, 0) << method << ": " << outcome.err;
    const Json document = Json::parse(outcome.out);
    expect_near_truth(document);
    const Json& estimate = document["estimate"];
    // The readings' scale is not given: it is estimated where it matters.
    EXPECT_NEAR(estimate["scale"], 1.0, 4.0 * document["stddev"]["scale"].get<double>() + 1e-12);
    EXPECT_LE(document["stddev_model"]["origin_m"][2], 1.000001 * document["stddev"]["origin_m"][2].get<double>());
    EXPECT_EQ(document["data"]["shots"]["cluster_z2"].size(), 18u);
    const bool is_joint = method == "joint";
    if (is_joint) EXPECT_EQ(document["verdict"]["state"], "good") << document["verdict"]["to_add"];
    for (const char* name : {"theta_x_rad", "theta_y_rad", "rms_px", "rms_range_m", "bound"})
      EXPECT_TRUE(estimate.contains(name)) << name;
    EXPECT_NEAR(estimate["theta_x_rad"], 1.557, 0.02);
    EXPECT_EQ(document["data"]["shots"]["range_m"].size(), 18u);
    EXPECT_EQ(document["counts"]["used"], 18);
    EXPECT_TRUE(std::filesystem::exists(path("out/rangefinder.yaml")));
    EXPECT_TRUE(std::filesystem::exists(path("out/camera.yaml")));
  }
}

const Json* assumption(const Json& document, const std::string& name) {
  for (const Json& each : document["assumed"])
    if (each["name"] == name) return &each;
  return nullptr;
}

TEST_F(RangefinderCommand, WhatIsGivenWithItsSigmaIsCarriedAndWhatIsNotIsNamed) {
  simulate();
  const Outcome given = calibrate({"--sigma-scale", "0", "--sigma-square", "0.00002", "--json", "--no-report"});
  ASSERT_EQ(given.code, 0) << given.err;
  const Json document = Json::parse(given.out);
  EXPECT_EQ(document["estimate"]["scale"], 1.0);
  EXPECT_EQ(document["verdict"]["state"], "good") << document["verdict"]["to_add"];
  ASSERT_TRUE(assumption(document, "square_m") && assumption(document, "scale") && assumption(document, "camera.f"));
  EXPECT_EQ((*assumption(document, "square_m"))["sigma"], 0.00002);
  EXPECT_EQ((*assumption(document, "scale"))["sigma"], 0.0);
  EXPECT_NEAR((*assumption(document, "camera.f"))["sigma"].get<double>(), 1.5 / std::sqrt(2.0), 1e-6);
  // A camera of unknown covariance moves the direction by many σ.
  std::string camera = read_file(path("sim/camera.yaml"));
  write_file(path("sim/camera.yaml"), camera.substr(0, camera.find("covariance:")));
  const Outcome unknown = calibrate({"--sigma-scale", "0", "--sigma-square", "0", "--json", "--no-report"});
  ASSERT_EQ(unknown.code, 0) << unknown.err;
  const Json care = Json::parse(unknown.out);
  EXPECT_EQ(care["verdict"]["state"], "care");
  EXPECT_NE(care["verdict"]["sentence"].get<std::string>().find("camera.c"), std::string::npos) << care["verdict"];
  EXPECT_EQ(calibrate({"--scale", "--sigma-scale", "0.001"}).code, 2);
  EXPECT_EQ(calibrate({"--sigma-scale", "-1"}).code, 2);
}

/// Shots know the ratio of readings and squares alone: a scale that is asked for is as good as the square.
TEST_F(RangefinderCommand, AScaleThatIsAskedForNeedsTheSquaresSigma) {
  simulate();
  const Json without = Json::parse(calibrate({"--scale", "--json", "--no-report"}).out);
  EXPECT_EQ(without["verdict"]["state"], "care");
  EXPECT_THAT(without["verdict"]["sentence"].get<std::string>(), ::testing::HasSubstr("square_m is given without σ"));
  EXPECT_EQ(without["verdict"]["to_add"], "measure the squares and give --sigma-square");
  const Json with = Json::parse(calibrate({"--scale", "--sigma-square", "0.00002", "--json", "--no-report"}).out);
  EXPECT_EQ(with["verdict"]["state"], "good") << with["verdict"];
  EXPECT_NEAR(with["estimate"]["scale"], 1.0, 4.0 * with["stddev"]["scale"].get<double>());
}

TEST_F(RangefinderCommand, ProjectSaysWhereAFileHasNoCovariance) {
  simulate();
  const auto project = [&](const std::string& beam, const std::string& camera) {
    const Outcome outcome = alidade({"project", "--beam", beam, "--camera", camera, "--range", "2", "--json",
                                     "--no-report", "--out", path("projected")});
    return Json::parse(outcome.out);
  };
  ASSERT_EQ(calibrate({"--no-report"}).code, 0);
  const Json known = project(path("out/rangefinder.yaml"), path("out/camera.yaml"));
  EXPECT_EQ(known["verdict"]["state"], "good");
  EXPECT_TRUE((*assumption(known, "camera.cx"))["sigma"].is_number());
  EXPECT_EQ(project(path("sim/truth_rangefinder.yaml"), path("out/camera.yaml"))["verdict"]["state"], "care");
  const std::string camera = read_file(path("out/camera.yaml"));
  write_file(path("bare.yaml"), camera.substr(0, camera.find("covariance:")));
  const Json bare = project(path("out/rangefinder.yaml"), path("bare.yaml"));
  EXPECT_TRUE((*assumption(bare, "camera.cx"))["sigma"].is_null());
  EXPECT_GT((*assumption(bare, "camera.cx"))["moves"], 0.5);
}

TEST_F(RangefinderCommand, ProjectNamesAnotherCamera) {
  simulate();
  ASSERT_EQ(calibrate({"--no-report"}).code, 0);
  const auto projected = [&](const std::string& camera) {
    return Json::parse(alidade({"project", "--beam", path("out/rangefinder.yaml"), "--camera", camera, "--range", "2",
                                "--json", "--no-report", "--out", path("projected")})
                           .out)["verdict"];
  };
  // The file that the beam was refined from is of the same camera.
  EXPECT_EQ(projected(path("sim/camera.yaml"))["state"], "good");
  std::string camera = read_file(path("out/camera.yaml"));
  // Errors of beam and lens cannot go together as they did when both were found.
  Camera surer = read_camera(path("out/camera.yaml"));
  surer.cov *= 0.5;
  write_camera(path("surer.yaml"), surer);
  EXPECT_EQ(projected(path("surer.yaml"))["state"], "care");
  const std::size_t at = camera.find("cx:");
  camera.replace(at, camera.find('\n', at) - at, "cx: 700");
  write_file(path("other.yaml"), camera);
  const Json other = projected(path("other.yaml"));
  EXPECT_EQ(other["state"], "care");
  EXPECT_NE(other.dump().find("not the camera that the beam was calibrated with: its cx is 700 px"), std::string::npos)
      << other;
}

TEST_F(RangefinderCommand, ProjectIsNoSurerThanTheRunThatMadeTheBeam) {
  simulate();
  ASSERT_EQ(calibrate({"--no-report", "--scale"}).code, 0);
  ASSERT_NE(read_file(path("out/rangefinder.yaml")).find("\nverdict: care\n"), std::string::npos);
  const Json verdict = Json::parse(alidade({"project", "--beam", path("out/rangefinder.yaml"), "--range", "2", "--json",
                                            "--no-report", "--out", path("projected")})
                                       .out)["verdict"];
  EXPECT_EQ(verdict["state"], "care");
  EXPECT_THAT(verdict["sentence"].get<std::string>(), ::testing::HasSubstr("rangefinder.yaml says ◆"));
}

TEST_F(RangefinderCommand, PointsToTheCornersWhereNobodyHasThePhotos) {
  simulate();
  const std::vector<std::string> arguments{"rangefinder", path("sim/shots.csv"),
                                           "--camera",    path("sim/camera.yaml"),
                                           "--board",     "9x6",
                                           "--square",    "0.04",
                                           "--out",       path("out")};
  const Outcome outcome = alidade(arguments);
  EXPECT_EQ(outcome.code, 3);
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("shot_001.png"));
  EXPECT_THAT(outcome.err, ::testing::HasSubstr("--corners " + path("sim/corners.csv")));
}

/// Photos in which nothing is to be found are not needed.
TEST_F(RangefinderCommand, SpotsThatAreGivenNeedNoPhotos) {
  simulate();
  for (const char* method : {"spot", "joint"}) {
    const Outcome outcome = calibrate_table(read_file(path("sim/shots.csv")), {"--method", method, "--json"});
    ASSERT_EQ(outcome.code, 0) << method << outcome.err;
    expect_near_truth(Json::parse(outcome.out));
  }
}

TEST_F(RangefinderCommand, CornersOfNoShotAreNamed) {
  simulate();
  const std::string corners = read_file(path("sim/corners.csv")), header = corners.substr(0, corners.find('\n') + 1);
  const auto renamed = [&](const std::string& from, const std::string& to) {
    std::string text = corners;
    for (std::size_t at = text.find(from); at != std::string::npos; at = text.find(from, at + to.size()))
      text.replace(at, from.size(), to);
    write_file(path("sim/corners.csv"), text);
    return calibrate({"--json", "--no-report"});
  };
  const Outcome none = renamed("shot_", "img_");
  EXPECT_EQ(none.code, 3) << none.out;
  EXPECT_THAT(none.err, ::testing::HasSubstr("has corners of no shot's photo: 'img_001.png' is none of them"));
  EXPECT_EQ(std::ranges::count(none.err, '\n'), 1) << none.err;
  const Outcome one = renamed("shot_001.png", "img_001.png");
  ASSERT_EQ(one.code, 0) << one.err;
  const Json counts = Json::parse(one.out)["counts"];
  EXPECT_EQ(counts["given"], 18);
  ASSERT_EQ(counts["skipped"].size(), 1u);
  EXPECT_EQ(counts["skipped"][0]["reason"], "no shot has the photo 'img_001.png': its 54 corners are not used");
  write_file(path("sim/corners.csv"), header);
  const Outcome empty = calibrate({"--no-report"});
  EXPECT_EQ(empty.code, 3) << empty.out;
  EXPECT_THAT(empty.err, ::testing::HasSubstr("corners.csv: has no corners"));
  // A wrong row of the corners is rejected by name, as one of the shots is.
  write_file(path("sim/corners.csv"),
             corners + corners.substr(header.size(), corners.find('\n', header.size()) + 1 - header.size()));
  EXPECT_EQ(calibrate({"--no-report"}).code, 3);
  const Outcome skipped = calibrate({"--skip-bad", "--json", "--no-report"});
  ASSERT_EQ(skipped.code, 0) << skipped.err;
  EXPECT_EQ(Json::parse(skipped.out)["counts"]["skipped"].size(), 1u);
}

TEST_F(RangefinderCommand, ProjectSaysWhereTheSpotIsAndHowSure) {
  simulate();
  ASSERT_EQ(calibrate({"--no-report"}).code, 0);
  const Outcome outcome =
      alidade({"project", "--beam", path("out/rangefinder.yaml"), "--camera", path("out/camera.yaml"), "--range",
               "2.31", "--json", "--no-report", "--out", path("projected")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  // By hand: X = B + L A of the truth, f 1200 px, centre (640, 480).
  const double x = 0.04 + 2.31 * 0.013795889, y = -0.07 - 2.31 * 0.015203087, z = 0.04 + 2.31 * 0.999789248;
  const Json &px = document["estimate"]["px"], &sigma = document["stddev"]["px"];
  EXPECT_NEAR(px[0], 640.0 + 1200.0 * x / z, 4.0 * sigma[0].get<double>());
  EXPECT_NEAR(px[1], 480.0 + 1200.0 * y / z, 4.0 * sigma[1].get<double>());
  EXPECT_LT(sigma[0], 0.5);
  EXPECT_NEAR(document["estimate"]["point_in_cam_m"][2], z, 0.02);
  const Csv points = Csv::read(path("projected/points.csv"));
  EXPECT_EQ(points.num_rows(), 1u);
  EXPECT_NEAR(points.number(0, "u_px"), px[0], 1e-6);
}

TEST_F(RangefinderCommand, PlanProposesShotsThatLowerTheUncertainty) {
  simulate({"--shots", "6"});
  ASSERT_EQ(calibrate({"--no-report"}).code, 0);
  const Outcome outcome = alidade({"plan", "rangefinder", path("out"), "--json", "--no-report", "--out", path("plan")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json estimate = Json::parse(outcome.out)["estimate"];
  EXPECT_LT(estimate["sigma_planned_origin_m"], estimate["sigma_now_origin_m"]);
}

TEST_F(RangefinderCommand, DegenerateDataAreRefusedByName) {
  for (const auto& [scenario, method, reason] :
       std::vector<std::array<std::string, 3>>{{"equal_range", "spot", "equal ranges"},
                                               {"equal_range", "plane", "equal ranges"},
                                               {"table1", "plane", "equal ranges"},
                                               {"table1", "spot", "equal ranges"},
                                               {"frontal", "plane", "frontal boards"},
                                               {"parallel", "plane", "parallel boards"},
                                               {"through_centre", "spot", "centre"}}) {
    simulate({"--scenario", scenario});
    const Outcome outcome = calibrate({"--method", method, "--no-report"});
    EXPECT_EQ(outcome.code, 4) << scenario << ' ' << method << outcome.out;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << scenario << ' ' << method << ": " << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out/rangefinder.yaml"))) << scenario;
    EXPECT_TRUE(std::filesystem::exists(path("out/result.json")));
  }
  simulate();
  const Outcome scale = calibrate({"--method", "spot", "--scale", "--no-report"});
  EXPECT_EQ(scale.code, 4);
  EXPECT_NE(scale.err.find("scale"), std::string::npos) << scale.err;
}

TEST_F(RangefinderCommand, AnotherBoardAndTheSameShotTwiceAreNamed) {
  simulate();
  const Outcome turned =
      alidade({"rangefinder", path("sim/shots.csv"), "--camera", path("sim/camera.yaml"), "--corners",
               path("sim/corners.csv"), "--board", "6x9", "--square", "0.04", "--no-report", "--out", path("out")});
  EXPECT_EQ(turned.code, 4) << turned.out;
  EXPECT_NE(turned.err.find("no pose of the board fits its corners in 18 of 18 shots; check --board"),
            std::string::npos)
      << turned.err;
  std::string table = read_file(path("sim/shots.csv"));
  table += table.substr(table.rfind('\n', table.size() - 2) + 1);
  const Outcome twice = calibrate_table(table);
  EXPECT_EQ(twice.code, 3);
  EXPECT_NE(twice.err.find("the same shot is in an earlier row"), std::string::npos) << twice.err;
}

TEST_F(RangefinderCommand, WrongShotsAreNamed) {
  simulate({"--outliers", "0.17"});
  const Json made = Json::parse(read_file(path("sim/result.json")));
  ASSERT_EQ(made["estimate"]["outliers"].size(), 3u);
  const Outcome outcome = calibrate({"--json", "--no-report"});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  expect_near_truth(document);
  const Json& shots = document["data"]["shots"];
  for (std::size_t i = 0; i < 18; ++i) {
    const bool is_outlier = std::ranges::count(made["estimate"]["outliers"], shots["name"][i]) > 0;
    EXPECT_EQ(shots["used"][i].get<bool>(), !is_outlier) << shots["name"][i] << shots["reason"][i];
  }
  std::string named;  // as the table has them
  for (std::size_t i = 0; i < 18; ++i)
    if (!shots["used"][i].get<bool>()) named += (named.empty() ? "" : ", ") + shots["name"][i].get<std::string>();
  EXPECT_NE(document["verdict"]["to_add"].get<std::string>().find("rejected: " + named), std::string::npos)
      << document["verdict"]["to_add"] << named;
}

TEST_F(RangefinderCommand, SaysWhatIsWrongWithItsInput) {
  simulate();
  const auto expect = [&](const std::string& table, const std::string& what) {
    const Outcome outcome = calibrate_table(table);
    EXPECT_EQ(outcome.code, 3) << table << outcome.err;
    EXPECT_NE(outcome.err.find(what), std::string::npos) << outcome.err;
    EXPECT_EQ(std::ranges::count(outcome.err, '\n'), 1) << outcome.err;
    EXPECT_FALSE(std::filesystem::exists(path("out")));
  };
  expect("", "shots.csv");
  expect("range_m,u,v\n", "has no shots");
  expect("range_px,u,v\n2310,1,1\n", "has no column 'range_m'");
  expect("range_m\n2.31\n", "ranges alone");
  expect("range_m,u\n2.31,4\n", "'u' and 'v'");
  expect("range_m,nx,ny,nz\n2.31,0,0,1\n", "'nx', 'ny', 'nz' and 'd'");
  expect("range_m,u,v\n2.31,4,5\nnan,4,5\n", "shots.csv:3: column 'range_m': 'nan' is not a finite number");
  expect("range_m,u,v\n-2.31,4,5\n", "shots.csv:2: column 'range_m': '-2.31' is not above zero");
  expect("range_m,u,v\n2310,4,5\n", "ranges are metres");
  expect("range_m,u,v\n2.31,,5\n", "shots.csv:2: column 'u': is empty");
  expect("range_m,u,v\n2.31,1e300,5\n", "shots.csv:2");
  expect("range_m,nx,ny,nz,d\n2.31,0,0,2,-2\n", "the normal's length is 2, not 1");
  expect("range_m,nx,ny,nz,d\n2.31,0,0,1,0\n", "passes through the camera's centre");
  expect("range_m,nx,ny,nz,d\n2.31,0,0,1,2.3\n1.31,0,0,1,1.3\n1.5,0,0.6,0.8,1.5\n", "is 'd' of the other sign?");
  expect("range_m,photo\n2.31,none.jpg\n", "none.jpg");
  write_file(path("text.jpg"), "not an image");
  expect("range_m,photo\n2.31,text.jpg\n", "text.jpg");
  const Outcome skipped = calibrate_table("range_m,u,v\n2.31,4,5\nnan,4,5\n", {"--skip-bad", "--json"});
  EXPECT_EQ(skipped.code, 4) << skipped.err;  // one shot determines nothing
  EXPECT_EQ(Json::parse(skipped.out)["counts"]["skipped"].size(), 1u);
}

TEST_F(RangefinderCommand, WrongUsageAndBadFilesAreNamed) {
  simulate();
  EXPECT_EQ(alidade({"rangefinder", path("sim/shots.csv")}).code, 2);
  EXPECT_EQ(calibrate({"--method", "magic"}).code, 2);
  EXPECT_EQ(alidade({"rangefinder", path("sim/shots.csv"), "--camera", path("sim/camera.yaml"), "--board", "9x6"}).code,
            2);
  EXPECT_EQ(alidade({"project", "--beam", path("none.yaml"), "--range", "1"}).code, 3);
  EXPECT_EQ(alidade({"project", "--beam", path("sim/truth_rangefinder.yaml"), "--range", "-1"}).code, 2);
  write_file(path("bad.yaml"), "origin_m: [0, 0, 0]\ndirection: [0, 0, 2]\n");
  const Outcome outcome = alidade({"project", "--beam", path("bad.yaml"), "--range", "1"});
  EXPECT_EQ(outcome.code, 3);
  EXPECT_NE(outcome.err.find("direction: has the length 2, not 1"), std::string::npos) << outcome.err;
}

/// From rendered photos, found and solved without help: board, lens and spot with noise.
TEST_F(RangefinderCommand, FromPhotosTheOriginIsWithinThreeMillimetres) {
  simulate({"--photos", "--seed", "4"});
  const Outcome outcome = alidade({"rangefinder", path("sim/shots.csv"), "--camera", path("sim/camera.yaml"), "--board",
                                   "9x6", "--square", "0.04", "--json", "--out", path("out")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  expect_near_truth(document, 3.0);
  double squares_m2 = 0.0, cosine = 0.0;
  const std::vector<double> origin{0.04, -0.07, 0.04}, direction{0.013795889, -0.015203087, 0.999789248};
  for (std::size_t i = 0; i < 3; ++i) {
    squares_m2 += std::pow(document["estimate"]["origin_m"][i].get<double>() - origin[i], 2);
    cosine += document["estimate"]["direction"][i].get<double>() * direction[i];
  }
  EXPECT_LT(std::sqrt(squares_m2), 0.003);
  EXPECT_LT(std::acos(std::min(cosine, 1.0)) * 180.0 / M_PI, 0.05);
  EXPECT_TRUE(std::filesystem::exists(path("out/report.html")));
  for (const char* board : {"10x7", "8x5"}) {
    const Outcome other = alidade({"rangefinder", path("sim/shots.csv"), "--camera", path("sim/camera.yaml"), "--board",
                                   board, "--square", "0.04", "--no-report", "--out", path("other")});
    EXPECT_EQ(other.code, 4) << other.out;
    EXPECT_NE(other.err.find("use --board 9x6: they show that board"), std::string::npos) << other.err;
  }
}

}  // namespace
}  // namespace alidade
