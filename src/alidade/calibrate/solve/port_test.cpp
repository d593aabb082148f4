#include "alidade/calibrate/solve/port.h"

#include <gtest/gtest.h>

#include <cmath>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/judge.h"
#include "alidade/geometry/degree.h"
#include "alidade/simulate/boards/board_photos.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

constexpr ImageSize port_image{768, 576};
constexpr double sigma_px = 0.3;
const Board port_board{.cols = 14, .rows = 10, .square_m = 0.03};

Camera air_camera() {
  return {768, 576, Calibrated<Brown>{{576, 575, 384, 288, 0, -0.12, 0.05, 3e-4, -2e-4, 0}}, {}, 0.0, {}};
}

Camera port_camera(double gap_m, double tilt_deg) {
  Params<FlatPort> p;
  p.head<10>() = std::get<Calibrated<Brown>>(air_camera().lens).params;
  const double sin = std::sin(tilt_deg * degree);
  p.tail<6>() << gap_m, 0.01, 1.5, 1.34, 0.8 * sin, -0.6 * sin;
  return {768, 576, Calibrated<FlatPort>{p}, {}, 0.0, {}};
}

/// 30 boards at 0.5 to 1.4 m, a print of 0.45 m.
BoardScene scene_of(const Camera& camera, std::uint64_t seed, double max_tilt_rad = 0.6) {
  BoardSceneConfig config;
  config.num_photos = 30;
  config.max_tilt_rad = max_tilt_rad;
  config.min_fill = 0.27;
  config.max_fill = 0.83;
  return draw_board_scene(camera, port_board, config, seed);
}

PortKnowledge knowledge() { return {.air = air_camera(), .glass_m = 0.01}; }

struct Errors {
  double gap_m = 0.0, normal_rad = 0.0, gap_sigmas = 0.0;
};

Errors errors_of(const CalibrateReport& report, const Camera& truth) {
  const auto& found = std::get<Calibrated<FlatPort>>(report.camera.lens).params;
  const auto& expected = std::get<Calibrated<FlatPort>>(truth.lens).params;
  const double gap_m = found[10] - expected[10];
  return {std::abs(gap_m), std::asin(FlatPort::normal(found).cross(FlatPort::normal(expected)).norm()),
          gap_m / std::sqrt(report.camera.cov(10, 10))};
}

struct Port {
  double gap_m, tilt_deg;
};
class CalibratePort : public ::testing::TestWithParam<Port> {};

TEST_P(CalibratePort, FindsGapAndNormalAsWellAsItSays) {
  const Camera truth = port_camera(GetParam().gap_m, GetParam().tilt_deg);
  double gap_m2 = 0.0, worst_normal_rad = 0.0, squares = 0.0;
  constexpr int num_seeds = 6;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const auto views = simulate_views(scene_of(truth, seed), sigma_px, seed + 100);
    const auto report = calibrate(port_board, views, port_image, with_port({}, knowledge()));
    ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
    const Errors errors = errors_of(report, truth);
    gap_m2 += errors.gap_m * errors.gap_m / num_seeds;
    worst_normal_rad = std::max(worst_normal_rad, errors.normal_rad);
    squares += errors.gap_sigmas * errors.gap_sigmas;
    EXPECT_NEAR(report.noise_px, sigma_px, 0.02);  // eight σ of a σ from 30 × 140 corners
    RecordProperty("gap_error_mm_" + std::to_string(seed), std::to_string(1e3 * errors.gap_m));
  }
  EXPECT_LT(std::sqrt(gap_m2), 1.5e-3);  // its σ is 0.9 mm
  EXPECT_LT(worst_normal_rad, 0.3 * degree);
  EXPECT_LT(squares, 22.5);  // χ²₆ at 10⁻³
}

INSTANTIATE_TEST_SUITE_P(Ports, CalibratePort,
                         ::testing::Values(Port{0.01, 0.0}, Port{0.01, 3.0}, Port{0.05, 2.0}, Port{0.005, 1.0}));

TEST(CalibratePort, IsExactWithoutNoise) {
  const Camera truth = port_camera(0.05, 2.0);
  const BoardScene scene = scene_of(truth, 3);
  auto views = simulate_views(scene, 0.1, 5);
  for (std::size_t k = 0; k < views.size(); ++k) {
    const auto corners = true_corners(scene, k);
    for (Corner& corner : views[k].corners) {
      corner.px = corners[static_cast<std::size_t>(corner.index)];
      corner.cov.setIdentity();
    }
  }
  const auto report = calibrate(port_board, views, port_image, with_port({}, knowledge()));
  ASSERT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
  EXPECT_LT(errors_of(report, truth).gap_m, 1e-8);
  EXPECT_LT(errors_of(report, truth).normal_rad, 1e-8);
}

// The residual of a calibration in water cannot reveal the port: a brown lens fits the same photos as well.
TEST(CalibratePort, BrownFitsTheSamePhotosAsWell) {
  const Camera truth = port_camera(0.05, 2.0);
  const auto views = simulate_views(scene_of(truth, 4), sigma_px, 8);
  const auto port = calibrate(port_board, views, port_image, with_port({}, knowledge()));
  const auto brown = calibrate(port_board, views, port_image, {});
  ASSERT_EQ(port.status, CalibrateReport::Status::converged);
  ASSERT_EQ(brown.status, CalibrateReport::Status::converged);
  RecordProperty("port_rms_px", std::to_string(port.rms_px));
  RecordProperty("brown_rms_px", std::to_string(brown.rms_px));
  EXPECT_NEAR(brown.rms_px / port.rms_px, 1.0, 0.015);  // 0.8 % here
}

TEST(CalibratePort, RefusesWhatParallelBoardsDoNotDetermine) {
  const auto views = simulate_views(scene_of(port_camera(0.02, 0.0), 5, 0.0), sigma_px, 9);
  PortKnowledge nothing = knowledge();
  nothing.air.reset();
  const auto report = calibrate(port_board, views, port_image, with_port({}, nothing));
  EXPECT_EQ(report.status, CalibrateReport::Status::degenerate);
  EXPECT_FALSE(report.reason.empty());
}

TEST(CalibratePort, RefusesAFreeLensAndFreeIndices) {
  const auto views = simulate_views(scene_of(port_camera(0.02, 1.0), 6), sigma_px, 9);
  PortKnowledge nothing = knowledge();
  nothing.air.reset();
  CalibrateConfig config = with_port({}, nothing);
  config.fixed = {"skew"};  // glass and indices as well
  const auto report = calibrate(port_board, views, port_image, config);
  EXPECT_NE(report.status, CalibrateReport::Status::converged);
}

TEST(CalibratePort, RefusesAGapBelowZeroAndHoldsItAtZero) {
  const Camera truth = port_camera(0.0, 1.0);
  int refused = 0;
  for (std::uint64_t seed = 1; seed <= 8; ++seed) {
    const auto views = simulate_views(scene_of(truth, seed), sigma_px, seed + 20);
    const auto report = calibrate(port_board, views, port_image, with_port({}, knowledge()));
    if (report.status == CalibrateReport::Status::degenerate) {
      EXPECT_TRUE(report.reason.starts_with("gap_m comes out below zero")) << report.reason;
      ++refused;
    } else {
      EXPECT_EQ(report.status, CalibrateReport::Status::converged) << report.reason;
    }
    PortKnowledge on_glass = knowledge();
    on_glass.gap_m = 0.0;
    const auto held = calibrate(port_board, views, port_image, with_port({.fixed = {"skew", "gap_m"}}, on_glass));
    EXPECT_EQ(held.status, CalibrateReport::Status::converged) << held.reason;
    EXPECT_LT(errors_of(held, truth).normal_rad, 0.3 * degree);
  }
  EXPECT_GT(refused, 0);  // half of them, but for chance
  EXPECT_LT(refused, 8);
}

TEST(CalibratePort, JudgesWhetherBrownWouldDo) {
  const auto judged = [](double gap_m) {
    PhotoCalibration photos;
    photos.size = port_image;
    photos.views = simulate_views(scene_of(port_camera(gap_m, 0.0), 7), sigma_px, 10);
    photos.reasons.resize(photos.views.size());
    const CalibrateConfig config = with_port({}, knowledge());
    photos.report = calibrate(port_board, photos.views, port_image, config);
    return judge_calibration(port_board, std::move(photos), config);
  };
  const Calibration thin = judged(0.01), thick = judged(0.10);
  ASSERT_TRUE(thin.port && thick.port);
  EXPECT_TRUE(thin.port->brown_is_enough) << port_sentence(*thin.port);
  EXPECT_FALSE(thick.port->brown_is_enough) << port_sentence(*thick.port);
  EXPECT_NE(port_sentence(*thick.port).find("use the flat_port camera"), std::string::npos);
  EXPECT_EQ(thin.verdict.exit_code, ExitCode::ok);
}

}  // namespace
}  // namespace alidade
