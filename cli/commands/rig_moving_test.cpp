#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <sstream>

#include "alidade/files/csv.h"
#include "alidade/files/files.h"
#include "alidade/formats/rig_file.h"
#include "alidade/tables/events_file.h"
#include "alidade/testing/command_test.h"

namespace alidade {
namespace {

using testing::Outcome;
using Json = nlohmann::json;

/// The drone of ETH's data set 1: seen by four cameras by hand-held labels, and by its own RTK receiver.
class MovingTargetCommand : public testing::CommandTest {
 protected:
  void SetUp() override {
    const char* data = std::getenv("ALIDADE_DATA");
    data_ = std::filesystem::path(data ? data : "") / "data/drone-tracking";
    if (!data || !std::filesystem::exists(data_ / "dataset1"))
      GTEST_SKIP() << "set ALIDADE_DATA to the folder that holds data/drone-tracking";
    std::string events = "t_capture_s,head,u_px,v_px\n";
    const std::array<const char*, 4> lenses{"iphone6", "p20pro", "sonyG_1", "sony5n_1920x1080"};
    for (std::size_t c = 0; c < lenses.size(); ++c) events += observations_of(c, write_camera(c, lenses[c]));
    write_file(path("sights.csv"), events);
    write_truth();
  }

  /// Returns the images a second.
  double write_camera(std::size_t c, const std::string& lens) {
    const Json json = Json::parse(read_file(data_ / "calibration" / (lens + ".json")));
    const Json &K = json["K-matrix"], &size = json["resolution"];
    const auto k = json["distCoeff"].get<std::vector<double>>();
    std::string text = fmt::format("model: brown\nwidth: {}\nheight: {}\nfx: {}\nfy: {}\ncx: {}\ncy: {}\n",
                                   size[0].get<int>(), size[1].get<int>(), K[0][0].get<double>(), K[1][1].get<double>(),
                                   K[0][2].get<double>(), K[1][2].get<double>());
    const std::array<const char*, 5> names{"k1", "k2", "p1", "p2", "k3"};
    for (std::size_t i = 0; i < names.size(); ++i) text += fmt::format("{}: {}\n", names[i], i < k.size() ? k[i] : 0.0);
    write_file(path(fmt::format("lens_{}.yaml", c)), text);
    return json["fps"].get<double>();
  }
  std::string observations_of(std::size_t c, double rate_hz) const {
    std::istringstream rows(read_file(data_ / fmt::format("dataset1/detections/cam{}.txt", c)));
    std::string row, text;
    while (std::getline(rows, row)) {
      double frame = 0.0, u = 0.0, v = 0.0;
      if (std::sscanf(row.c_str(), "%lf %lf %lf", &frame, &u, &v) != 3 || (u == 0.0 && v == 0.0)) continue;
      text += fmt::format("{:.6f},{},{:.4f},{:.4f}\n", frame / rate_hz, c + 1, u, v);
    }
    return text;
  }
  void write_truth() {
    std::istringstream rows(read_file(data_ / "dataset1/trajectory/rtk.txt"));
    TrueTrack truth;
    double x = 0.0, y = 0.0, z = 0.0;
    while (rows >> x >> y >> z) {
      truth.t_s.push_back(0.2 * static_cast<double>(truth.t_s.size()));  // five a second
      truth.position.emplace_back(x, y, z);
    }
    write_file(path("truth.csv"), true_track_csv(truth));
  }
  [[nodiscard]] Outcome place(const std::vector<std::string>& options) const {
    std::vector<std::string> words{"rig",   path("sights.csv"), "--moving-target", "--json", "--no-report",
                                   "--out", path("rig")};
    for (int c = 0; c < 4; ++c) words.insert(words.end(), {"--camera", path(fmt::format("lens_{}.yaml", c))});
    return alidade(words, options);
  }

  std::filesystem::path data_;
};

/// Median distance from the truth where two cameras or more see the target (no word in column `event`).
double median_error_m(const std::string& track_file, const TrueTrack& truth, std::size_t& num) {
  const Csv csv = Csv::read(track_file);
  std::vector<double> errors;
  for (std::size_t row = 0; row < csv.num_rows(); ++row) {
    if (!csv.is_empty(row, "event") || csv.is_empty(row, "x_m")) continue;
    const auto there = truth.at(csv.number(row, "t_s"));
    if (!there) continue;
    const Eigen::Vector3d at(csv.number(row, "x_m"), csv.number(row, "y_m"), csv.number(row, "z_m"));
    errors.push_back((at - *there).norm());
  }
  num = errors.size();
  if (errors.empty()) return 1e9;
  std::ranges::sort(errors);
  return errors[errors.size() / 2];
}

TEST_F(MovingTargetCommand, ADroneIsFollowedByCamerasThatItPlacedItself) {
  const Outcome placed = place({"--clocks", "20", "--truth", path("truth.csv")});
  ASSERT_EQ(placed.code, 0) << placed.err;
  const Json document = Json::parse(placed.out), estimate = document["estimate"];
  for (const Json& camera : estimate["cameras"]) EXPECT_TRUE(camera["placed"].get<bool>()) << camera["reason"];
  // What the page draws: a camera is at its head's base, with that σ along the world's axes.
  const Json& cameras = document["data"]["cameras"];
  const std::array places{"world_from_cam_x_m", "world_from_cam_y_m", "world_from_cam_z_m"};
  const std::array variances{"cov_xx_m2", "cov_yy_m2", "cov_zz_m2"};
  ASSERT_EQ(cameras["id"].size(), 4u);
  for (std::size_t h = 0; h < 4; ++h) {
    const Json& place = estimate["heads"][h]["world_from_base"]["translation_m"];
    const Json& sigma = document["stddev"]["heads"][h]["world_from_base"]["translation_m"];
    for (std::size_t k = 0; k < 3; ++k) {
      EXPECT_NEAR(cameras[places[k]][h], place[k], 1e-9);
      const double variance = std::pow(sigma[k].get<double>(), 2);
      EXPECT_NEAR(cameras[variances[k]][h].get<double>(), variance, 1e-9 + 1e-6 * variance);
    }
  }
  // The truth gives seven numbers and a clock; the path itself is the cameras' own.
  EXPECT_LT(estimate["true_path"]["median_m"].get<double>(), 0.1);
  EXPECT_LT(estimate["true_path"]["rms_m"].get<double>(), 0.2);
  EXPECT_NEAR(estimate["true_path"]["clock_rate"].get<double>(), 1.0, 1e-3);
  const Outcome tracked = alidade({"track", path("rig/events.csv"), "--rig", path("rig/rig.yaml"), "--max-depth", "200",
                                   "--no-report", "--out", path("track")});
  ASSERT_EQ(tracked.code, 0) << tracked.err;
  std::size_t num = 0;
  EXPECT_LT(median_error_m(path("track/track.csv"), read_true_track(path("truth.csv")), num), 0.3);
  EXPECT_GT(num, 9000u);
}

TEST_F(MovingTargetCommand, OneClockAndNoScaleAreRefused) {
  const Outcome one_clock = place({"--truth", path("truth.csv")});
  EXPECT_EQ(one_clock.code, 4) << one_clock.err;
  EXPECT_NE(one_clock.err.find("clocks"), std::string::npos) << one_clock.err;
  EXPECT_FALSE(std::filesystem::exists(path("rig/rig.yaml")));
  for (const std::string wrong : {"1:2", "1:1:3", "1:2:-3", "one", "1:2:3:0"})
    EXPECT_EQ(place({"--distance", wrong}).code, 2) << wrong;
  EXPECT_EQ(place({"--distance", "1:9:3"}).code, 2);
  write_file(path("sights.csv"),
             "t_capture_s,head,pan_rad,tilt_rad,u_px,v_px\n0,1,0,0,5,5\n0,2,0,0,5,5\n0,3,0,0,5,5\n"
             "0,4,0,0,5,5\n1,1,0.1,0,5,5\n");
  const Outcome turning = place({});
  EXPECT_EQ(turning.code, 3);
  EXPECT_NE(turning.err.find("sights.csv:6: column 'pan_rad'"), std::string::npos) << turning.err;
}

}  // namespace
}  // namespace alidade
