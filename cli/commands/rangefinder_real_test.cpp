#include <fmt/format.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/testing/command_test.h"

// `alidade rangefinder` on recorded data of others.

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

class RealRangefinder : public testing::CommandTest {};

/// A true single-point rangefinder: 37 photos, readings in steps of 1 cm.
TEST_F(RealRangefinder, ARealRangefindersRangesArePredicted) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "ALIDADE_DATA is not set: the photos of a real rangefinder are not at hand";
  const std::string folder = std::string(data) + "/data/lidar1d-giubilato/";
  const Csv ranges = Csv::read(folder + "ranges_m.csv");
  std::string table = "range_m,photo\n";
  for (std::size_t row = 0; row < ranges.num_rows(); ++row)
    table += ranges.text(row, "range_m") + "," + folder + "images/" + ranges.text(row, "image") + "\n";
  write_file(path("shots.csv"), table);
  const Outcome camera = alidade({"calibrate", folder + "images", "--board", "8x6", "--square", "0.0387", "--no-report",
                                  "--quiet", "--out", path("camera")});
  ASSERT_TRUE(camera.code == 0 || camera.code == 6) << camera.err;  // its σ is not what this test is about
  const std::vector<std::string> command{"rangefinder", path("shots.csv"),
                                         "--camera",    path("camera/camera.yaml"),
                                         "--board",     "8x6",
                                         "--square",    "0.0387",
                                         "--method",    "plane",
                                         "--json",      "--no-report",
                                         "--out",       path("out")};
  const Outcome plain = alidade(command);
  ASSERT_EQ(plain.code, 0) << plain.err;
  EXPECT_NE(Json::parse(plain.out)["verdict"]["checks"].dump().find("--scale"), std::string::npos);
  std::vector<std::string> scaled = command;
  scaled.emplace_back("--scale");
  const Outcome outcome = alidade(scaled);
  ASSERT_EQ(outcome.code, 0) << outcome.err;
  const Json document = Json::parse(outcome.out);
  const Json& estimate = document["estimate"];
  EXPECT_LT(estimate["left_out"]["rms_range_m"], 0.018);
  // The authors' own unconstrained fit has |direction| 0.975: the same scale.
  EXPECT_NEAR(estimate["scale"], 0.98, 0.02);
  EXPECT_GT((1.0 - estimate["scale"].get<double>()) / document["stddev"]["scale"].get<double>(), 3.0);
  EXPECT_GE(estimate["noise"]["sigma_range_m"], 0.01 / std::sqrt(12.0) * 0.999);  // the steps of the readings
  // σ covers the scatter: residuals over their σ.
  double squares = 0.0;
  int num = 0;
  const Json& shots = document["data"]["shots"];
  for (std::size_t i = 0; i < shots["used"].size(); ++i) {
    if (!shots["used"][i].get<bool>()) continue;
    squares +=
        std::pow(shots["residual_range_m"][i].get<double>() / shots["sigma_residual_range_m"][i].get<double>(), 2);
    ++num;
  }
  EXPECT_GE(num, 34);
  EXPECT_NEAR(std::sqrt(squares / (num - 6)), 1.0, 0.35);
}

/// One bearing of a 3-D scanner is a single-point rangefinder: the median of the ranges that its scan of each board
/// has there. Scans in the scanner's frame.
class ScannersBearing {
 public:
  explicit ScannersBearing(std::string folder) : folder_(std::move(folder)) {
    for (int k = 1; k <= 15; ++k) {
      std::istringstream points(read_file(folder_ + "laser_target" + std::to_string(k) + ".xyz"));
      Eigen::Vector3d point;
      while (points >> point.x() >> point.y() >> point.z()) scans_[k].push_back(point);
    }
  }
  static Eigen::Vector3d direction(double azimuth_deg, double elevation_deg) {
    constexpr double degree = 0.017453292519943295;
    const double a = azimuth_deg * degree, e = elevation_deg * degree;
    return {std::cos(e) * std::cos(a), std::cos(e) * std::sin(a), std::sin(e)};
  }
  [[nodiscard]] std::string shots(const Eigen::Vector3d& bearing) const {
    constexpr double near = 0.005, widest_m = 0.05, farthest_m = 3.2;  // behind the boards is a wall
    constexpr std::size_t num = 5;
    std::string table = "range_m,photo\n";
    for (const auto& [k, points] : scans_) {
      std::map<double, double> nearest;
      for (const Eigen::Vector3d& point : points) {
        const double away = (point.normalized() - bearing).norm();
        if (away < near) nearest[away] = point.norm();
      }
      std::vector<double> ranges;
      for (const auto& [away, range_m] : nearest)
        if (ranges.size() < num) ranges.push_back(range_m);
      std::ranges::sort(ranges);
      if (ranges.size() < 3 || ranges.back() - ranges.front() > widest_m) continue;  // an edge
      if (ranges.back() > farthest_m) continue;
      table += fmt::format("{:.5f},{}img_target{}.jpg\n", ranges[ranges.size() / 2], folder_, k);
    }
    return table;
  }

 private:
  std::string folder_;
  std::map<int, std::vector<Eigen::Vector3d>> scans_;
};

/// The boards were at nearly one distance: unobservable. By the published pose two of the bearings missed 9 of 14 and
/// 13 of 15 boards, and read the background, up to 46 cm off: that is reported first. What the data do determine is
/// within its σ of the pose.
TEST_F(RealRangefinder, BearingsOfARealScannerAreWithinTheirSigmaOfThePublishedPose) {
  const char* data = std::getenv("ALIDADE_DATA");
  if (!data) GTEST_SKIP() << "ALIDADE_DATA is not set: the scans are not at hand";
  const ScannersBearing scanner(std::string(data) + "/data/lcct-laser3d/");
  write_file(path("camera.yaml"),
             "model: brown\nwidth: 640\nheight: 480\nfx: 1588.85\nfy: 1589.14\ncx: 336.85\ncy: 166.22\n"
             "k1: -0.18345\nk2: -0.0344\np1: -0.00547\np2: 0.00439\nk3: 0\n");
  Eigen::Matrix3d cam_from_scanner;
  cam_from_scanner << -0.527226, 0.849650, -0.011278, 0.111189, 0.055825, -0.992230, -0.842419, -0.524383, -0.123904;
  const Eigen::Vector3d origin(-0.198980, 0.016672, -0.091506);
  struct Asked {
    double azimuth_deg, elevation_deg;
    int code;
    const char* reason;
  };
  for (const auto& [azimuth_deg, elevation_deg, code, reason] : {Asked{-156.0, -16.0, 4, "equal ranges"},
                                                                 {-152.0, -13.0, 5, "that the beam hit the board"},
                                                                 {-144.0, -13.0, 5, "that the beam hit the board"}}) {
    const Eigen::Vector3d bearing = ScannersBearing::direction(azimuth_deg, elevation_deg);
    write_file(path("shots.csv"), scanner.shots(bearing));
    const Outcome outcome =
        alidade({"rangefinder", path("shots.csv"), "--camera", path("camera.yaml"), "--board", "7x5", "--square",
                 "0.03", "--method", "plane", "--no-report", "--out", path("out"), "--json"});
    EXPECT_EQ(outcome.code, code) << outcome.err;
    EXPECT_NE(outcome.err.find(reason), std::string::npos) << outcome.err;
    const Json document = Json::parse(read_file(path("out/result.json")));
    EXPECT_GE(document["counts"]["used"], 10);
    const Json &estimate = document["estimate"], &stddev = document["stddev"];
    const Eigen::Vector3d direction = cam_from_scanner * bearing;
    for (std::size_t i = 0; i < 3; ++i) {
      const auto axis = static_cast<Eigen::Index>(i);
      EXPECT_LT(std::abs(estimate["origin_m"][i].get<double>() - origin[axis]),
                3.0 * stddev["origin_m"][i].get<double>());
      EXPECT_LT(std::abs(estimate["direction"][i].get<double>() - direction[axis]),
                3.0 * stddev["direction"][i].get<double>());
    }
  }
}

}  // namespace
}  // namespace alidade
