#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "alidade/observe.h"
#include "alidade/simulate/draws.h"

// Four seconds of a head whose images are late, with a point that hardly anything determines.

namespace alidade {
namespace {

constexpr int width = 320, height = 240;
constexpr double true_f = 350.0, delay_s = 0.015;

Eigen::Vector2d angles_at(double t_s) {
  constexpr double turn = 2.0 * std::numbers::pi;
  return {0.3 * std::sin(turn * t_s / 4.0 + 1.0), 0.15 * std::sin(turn * t_s / 2.7)};
}

/// One that is lost after two rows, and was not the same in both.
void see_twice(RotationLog& log) {
  for (std::size_t i = 0; i < log.num_points; ++i) {
    if (!is_seen(log.rows[0].px[i]) || !is_seen(log.rows[1].px[i])) continue;
    log.rows[1].px[i] += Eigen::Vector2d(-1.0, 0.04);
    for (std::size_t k = 2; k < log.rows.size(); ++k) log.rows[k].px[i].setConstant(not_seen);
    return;
  }
}

RotationLog late_log(std::uint64_t seed) {
  Draws draws(seed);
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 120; ++i) {
    const double lon = draws.uniform(-0.75, 0.75), lat = draws.uniform(-0.5, 0.5);
    points.emplace_back(std::sin(lon) * std::cos(lat), std::sin(lat), std::cos(lon) * std::cos(lat));
  }
  RotationLog log{.source = RotationSource::head, .num_points = points.size()};
  log.sigma_parallax = 0.0;
  for (int k = 0; k < 120; ++k) {
    RotationRow row{.t_s = k / 30.0};
    row.pan_tilt_roll_rad << angles_at(row.t_s), 0.0;
    const Eigen::Vector2d then = angles_at(row.t_s - delay_s);  // pan > 0 turns left, tilt > 0 up
    const Eigen::Matrix3d base_from_cam =
        (Eigen::AngleAxisd(-then.x(), Eigen::Vector3d::UnitY()) * Eigen::AngleAxisd(then.y(), Eigen::Vector3d::UnitX()))
            .toRotationMatrix();
    for (const Eigen::Vector3d& point : points) {
      const Eigen::Vector3d in_cam = base_from_cam.transpose() * point;
      const Eigen::Vector2d px = true_f * in_cam.hnormalized() + Eigen::Vector2d(159.5, 119.5) + 0.2 * draws.normal2();
      const bool is_inside = in_cam.z() > 0.0 && px.minCoeff() > 0.0 && px.x() < width - 1 && px.y() < height - 1;
      row.px.push_back(is_inside ? px : Eigen::Vector2d::Constant(not_seen));
    }
    log.rows.push_back(std::move(row));
  }
  see_twice(log);
  return log;
}

/// A point that hardly anything determines goes on along its Huber cost for as long as it may: what all have in common
/// has long settled, and is the answer.
TEST(ShortLog, ADelayIsFoundBesidePointsThatNeverSettle) {
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    ObserveConfig config;
    config.width_px = width;
    config.height_px = height;
    config.estimate = {"delay"};
    config.method = ObserveMethod::batch;
    const ObserveReport report = observe(late_log(seed), config);
    ASSERT_GT(report.quantities.size(), 4u) << seed << ": " << report.verdict.sentence;
    EXPECT_NEAR(report.quantities[0].value, true_f, 5.0 * report.quantities[0].sigma) << seed;
    EXPECT_LT(report.quantities[0].sigma, 0.002 * true_f) << seed;
    EXPECT_EQ(report.quantities[4].name, "delay_s");
    EXPECT_NEAR(report.quantities[4].value, -delay_s, 1e-3) << seed;
  }
}

}  // namespace
}  // namespace alidade
