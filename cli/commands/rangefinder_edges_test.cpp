#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <opencv2/imgcodecs.hpp>

#include "alidade/files/files.h"
#include "alidade/formats/beam_file.h"
#include "alidade/formats/camera_file.h"
#include "alidade/testing/command_test.h"
#include "alidade/testing/edge_scene.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::Outcome;

/// A photo of a room, and the scan of a rangefinder that rotated with the camera.
class EdgesCommand : public testing::CommandTest {
 protected:
  void SetUp() override {
    const Camera camera = testing::edge_camera();
    GreyImage photo = testing::photo_of(camera);
    const cv::Mat image(photo.height_px, photo.width_px, CV_32F, photo.values.data());
    ASSERT_TRUE(cv::imwrite(path("photo.png"), image));
    write_file(path("camera.yaml"), camera_text(camera, CameraFormat::alidade));
    truth_.origin_in_cam = {0.04, -0.05, 0.0};
    truth_.direction_in_cam = Eigen::Vector3d(0.03, -0.025, 1.0).normalized();
    write_file(path("scan.csv"), csv_of(testing::scan_of(truth_, 0.0044)));
  }
  static std::string csv_of(const std::vector<ScanRow>& scan) {
    std::string text = "pan,tilt,range_m\n";
    for (const ScanRow& row : scan) text += fmt::format("{},{},{}\n", row.pan_rad, row.tilt_rad, row.range_m);
    return text;
  }
  [[nodiscard]] Outcome align(const std::vector<std::string>& options) const {
    return alidade({"rangefinder", path("scan.csv"), "--method", "edges", "--camera", path("camera.yaml"), "--out",
                    path("out"), "--no-report"},
                   options);
  }
  Beam truth_;
};

TEST_F(EdgesCommand, FindsTheDirectionAndSaysWhatItIsWorth) {
  const Outcome outcome = align({"--photo", path("photo.png")});
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const nlohmann::json document = nlohmann::json::parse(read_file(path("out/result.json")));
  EXPECT_EQ(document["verdict"]["state"], "care");  // a check, not a calibration
  EXPECT_EQ(document["estimate"]["method"], "edges");
  // The covariance is in the document as it is in the beam's file: 7 parameters, its diagonal the σ.
  ASSERT_EQ(document["covariance"]["names"].size(), 7u);
  ASSERT_EQ(document["covariance"]["upper"].size(), 28u);
  EXPECT_NEAR(std::sqrt(document["covariance"]["upper"][0].get<double>()),
              document["stddev"]["origin_m"][0].get<double>(), 1e-9);
  const Beam found = read_beam(path("out/rangefinder.yaml")).beam;
  EXPECT_LT((found.direction_in_cam - truth_.direction_in_cam).norm(), 0.0084);  // as edges_test.cpp says
  const Outcome from_there = align({"--photo", path("photo.png"), "--start", path("out/rangefinder.yaml")});
  EXPECT_EQ(from_there.code, 0) << from_there.err;
}

TEST_F(EdgesCommand, SaysWhatIsWrongWithItsInput) {
  const auto said = [](const Outcome& outcome) { return std::to_string(outcome.code) + " " + outcome.err; };
  EXPECT_THAT(said(align({})), AllOf(HasSubstr("2 "), HasSubstr("--photo")));
  EXPECT_THAT(said(align({"--photo", path("nowhere.png")})), AllOf(HasSubstr("3 "), HasSubstr("nowhere.png")));
  EXPECT_THAT(said(align({"--photo", path("scan.csv")})), AllOf(HasSubstr("3 "), HasSubstr("scan.csv")));
  write_file(path("scan.csv"), "pan,tilt,range_m\n0,0,2\n0.1,0,nan\n");
  EXPECT_THAT(said(align({"--photo", path("photo.png")})), AllOf(HasSubstr("3 "), HasSubstr("scan.csv:3")));
  write_file(path("scan.csv"), "pan,tilt,range_m\n");
  EXPECT_THAT(said(align({"--photo", path("photo.png")})), HasSubstr("3 "));
  write_file(path("scan.csv"), "pan,tilt,range_m\n10,20,2\n20,20,2\n");
  EXPECT_THAT(said(align({"--photo", path("photo.png")})), HasSubstr("3 "));
}

TEST_F(EdgesCommand, RefusesASceneWithoutDepth) {
  std::vector<ScanRow> flat = testing::scan_of(truth_, 0.02);
  for (ScanRow& row : flat) row.range_m = 4.0;
  write_file(path("scan.csv"), csv_of(flat));
  EXPECT_EQ(align({"--photo", path("photo.png")}).code, 4);
  EXPECT_FALSE(std::filesystem::exists(path("out/rangefinder.yaml")));
}

}  // namespace
}  // namespace alidade
