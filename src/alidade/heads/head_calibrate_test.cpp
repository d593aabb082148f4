#include "alidade/heads/head_calibrate.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/geometry/degree.h"
#include "alidade/heads/simulated_head.h"
#include "alidade/heads/turn_log.h"
#include "alidade/observe.h"
#include "alidade/tables/rotation_log_file.h"

// A head and a camera that are simulated, in a time of their own: rendered frames, points followed in them.

namespace alidade {
namespace {

constexpr const char* camera_words = "size=320x240&mount=1:-2:3&delay=0.04";

HeadCalibration calibrated(const std::string& head_words, const HeadCalibrationConfig& config) {
  const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&" + head_words);
  const std::unique_ptr<FrameStream> stream = open_stream(std::string("sim://?") + camera_words, *head);
  return calibrate_head(*head, *stream, config);
}

double value_of(const ObserveReport& report, const std::string& name, double& sigma) {
  for (const ObservedQuantity& each : report.quantities) {
    if (each.name != name) continue;
    sigma = each.sigma;
    return each.value;
  }
  ADD_FAILURE() << name;
  return std::nan("");
}

HeadRange range_of(double pan_deg, double low_tilt_deg, double high_tilt_deg) {
  return {Eigen::Vector2d(-pan_deg, low_tilt_deg) * degree, Eigen::Vector2d(pan_deg, high_tilt_deg) * degree};
}

TEST(HeadCalibrate, LensMountingAndDelayWithinThreeSigma) {
  const HeadCalibration result = calibrated("rate=8", {.range = range_of(60, -20, 40), .until = 0.003});
  ASSERT_EQ(result.verdict.exit_code, ExitCode::ok) << result.verdict.sentence;
  EXPECT_LT(result.head_time_s, 90.0);
  EXPECT_EQ(result.times, FrameTimes::stamped);
  const SimulatedCamera truth = simulated_camera(camera_words, "test");
  const std::vector<std::pair<std::string, double>> truths{{"fx", truth.fx},
                                                           {"fy", truth.fy},
                                                           {"cx", truth.cx},
                                                           {"cy", truth.cy},
                                                           {"k1", truth.k1},
                                                           {"mount_x_rad", truth.mount_rad[0]},
                                                           {"mount_y_rad", truth.mount_rad[1]},
                                                           {"mount_z_rad", truth.mount_rad[2]}};
  for (const auto& [name, value] : truths) {
    double sigma = 0.0;
    const double found = value_of(result.report, name, sigma);
    EXPECT_LE(std::abs(found - value), 3.5 * sigma) << name << " " << found << " for " << value << " ± " << sigma;
  }
  double sigma = 0.0;
  EXPECT_NEAR(value_of(result.report, "fx", sigma), truth.fx, 2e-4 * truth.fx);
  EXPECT_NEAR(value_of(result.report, "delay_s", sigma), -0.04, 2e-3);
  // Off line, from the text of the log: the same to the last digit.
  ObserveConfig config;
  config.estimate = {"k1", "mount", "delay"};
  config.no_zoom = true;
  config.method = ObserveMethod::batch;
  config.width_px = 320;
  config.height_px = 240;
  if (result.sigma_angle_rad > 0.0)
    config.rotation = RotationKnowledge::noisy, config.sigma_angle_rad = result.sigma_angle_rad;
  const ObserveReport again = observe(parse_rotation_log(result.log_csv, "log.csv").log, config);
  ASSERT_EQ(again.quantities.size(), result.report.quantities.size());
  for (std::size_t i = 0; i < again.quantities.size(); ++i)
    EXPECT_EQ(again.quantities[i].value, result.report.quantities[i].value) << again.quantities[i].name;
}

TEST(HeadCalibrate, FollowsABoardInsteadOfPoints) {
  const std::string camera = std::string(camera_words) + "&fps=8&board=9:6:0.025:0.9:3:2";
  const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free&rate=8");
  const std::unique_ptr<FrameStream> stream = open_stream("sim://?" + camera, *head);
  const HeadCalibrationConfig config{
      .range = range_of(60, -20, 40), .max_s = 16.0, .board = Board{.cols = 9, .rows = 6, .square_m = 0.025}};
  const HeadCalibration result = calibrate_head(*head, *stream, config);
  ASSERT_EQ(result.verdict.exit_code, ExitCode::ok) << result.verdict.sentence;
  EXPECT_EQ(parse_rotation_log(result.log_csv, "log.csv").log.num_points, 54u);
  double sigma = 0.0;
  const double fx = value_of(result.report, "fx", sigma);
  EXPECT_LE(std::abs(fx - 350.0), 3.5 * sigma);
  EXPECT_LT(3.0 * sigma, 0.02 * fx);
}

/// A head that is quicker than points can be followed is never seen to move evenly: its rests have to do.
TEST(HeadCalibrate, OfAQuickHeadEachRestCounts) {
  const std::string camera = std::string(camera_words) + "&fps=8&board=9:6:0.025:0.9:3:2";
  const std::unique_ptr<HeadDevice> head = open_head("sim://?clock=free");  // 40°/s
  const std::unique_ptr<FrameStream> stream = open_stream("sim://?" + camera, *head);
  const HeadCalibration result = calibrate_head(
      *head, *stream,
      {.range = range_of(60, -20, 40), .max_s = 24.0, .board = Board{.cols = 9, .rows = 6, .square_m = 0.025}});
  ASSERT_EQ(result.verdict.exit_code, ExitCode::ok) << result.verdict.sentence;
  double sigma = 0.0;
  const double fx = value_of(result.report, "fx", sigma);
  EXPECT_LE(std::abs(fx - 350.0), 3.5 * sigma);
  EXPECT_LT(3.0 * sigma, 0.02 * fx);
}

TEST(HeadCalibrate, KeepsAFewFramesOfEachRest) {
  std::vector<HeadPosition> readings;
  std::vector<SeenFrame> frames;
  for (int i = 0; i < 300; ++i) {  // three rests of 2 s, and between them it is faster and faster for a second
    const double t = 0.03 * i, begun = std::floor(t / 3.0), moved = std::max(0.0, t - 3.0 * begun - 2.0);
    readings.push_back({t, 1e-4, Eigen::Vector2d(0.1 * (begun + moved * moved * moved), 0.0)});
    if (i % 3 == 0) frames.push_back({t, {{1, {100.0, 100.0}}}});
  }
  const RotationLog log = turn_log(readings, frames, 0.0, 0.0);
  std::array<int, 3> rows{};
  for (const RotationRow& row : log.rows) {
    const double rest = row.pan_tilt_roll_rad[0] / 0.1;
    if (!row.px[0].allFinite() || std::abs(rest - std::round(rest)) > 1e-6) continue;
    ++rows[static_cast<std::size_t>(std::lround(rest))];
  }
  for (const int of_a_rest : rows) EXPECT_EQ(of_a_rest, 6);
}

TEST(HeadCalibrate, NamesFyWhereTiltIsFixed) {
  const HeadCalibration result = calibrated("rate=8", {.range = range_of(60, 0, 0), .until = 0.001, .max_s = 14.0});
  EXPECT_EQ(result.verdict.exit_code, ExitCode::undetermined);
  EXPECT_NE(result.verdict.sentence.find("fy"), std::string::npos) << result.verdict.sentence;
}

/// Readings of a head that stands for a second, moves evenly for two and stands; the answers take `wait_s`.
std::vector<HeadPosition> slow_readings(double wait_s, double jitter_s) {
  std::vector<HeadPosition> readings;
  double t = 0.0;
  for (int i = 0; t < 4.0; ++i) {
    const double wait = wait_s + (i % 3 == 0 ? jitter_s : 0.0), sampled_s = t + wait;  // at the end of its wait
    readings.push_back({t + 0.5 * wait, wait, Eigen::Vector2d(0.1 * std::clamp(sampled_s - 1.0, 0.0, 2.0), 0.0)});
    t += wait + 0.035;
  }
  return readings;
}

TEST(HeadCalibrate, SlowAnswersAreKnownAtRestAndWhereTheyAreAlike) {
  for (const double wait_s : {0.06, 0.15}) {
    const std::vector<HeadPosition> alike = slow_readings(wait_s, 0.0), not_alike = slow_readings(wait_s, 0.05);
    for (const std::vector<HeadPosition>& readings : {alike, not_alike}) {
      const HeadManner manner = manner_of(readings);
      const auto rest = even_motion(readings, manner, 0.5, 0.5, 0.5);
      ASSERT_TRUE(rest) << wait_s;
      EXPECT_TRUE(rest->rate_rad_s.isZero());
      for (const double t_s : {0.9, 1.0, 1.05, 2.95, 3.0, 3.04})
        EXPECT_FALSE(even_motion(readings, manner, t_s, t_s, t_s));
    }
    const auto moving = even_motion(alike, manner_of(alike), 2.0, 2.0, 2.0);
    ASSERT_TRUE(moving) << wait_s;
    EXPECT_NEAR(moving->pan_tilt_rad[0], 0.1 * (1.0 + 0.5 * wait_s), 1e-6);  // what all have in common is a delay
    EXPECT_FALSE(even_motion(not_alike, manner_of(not_alike), 2.0, 2.0, 2.0));
  }
}

TEST(HeadCalibrate, EvenMotionOnly) {
  std::vector<HeadPosition> readings;
  for (int i = 0; i < 100; ++i) {  // stands, moves evenly from 1 s to 3 s, stands
    const double t = 0.04 * i;
    readings.push_back({t, 1e-4, Eigen::Vector2d(0.1 * std::clamp(t - 1.0, 0.0, 2.0), 0.0)});
  }
  const HeadManner manner = manner_of(readings);
  EXPECT_NEAR(manner.fastest_rad_s[0], 0.1, 1e-6);
  EXPECT_TRUE(even_motion(readings, manner, 0.5, 0.5, 0.5));
  const auto moving = even_motion(readings, manner, 2.0, 1.96, 2.0);
  ASSERT_TRUE(moving);
  EXPECT_NEAR(moving->pan_tilt_rad[0], 0.1, 1e-9);
  EXPECT_NEAR(moving->rate_rad_s[0], 0.1, 1e-9);
  EXPECT_FALSE(even_motion(readings, manner, 1.0, 1.0, 1.0));
  EXPECT_FALSE(even_motion(readings, manner, 2.95, 2.95, 3.0));
}

}  // namespace
}  // namespace alidade
