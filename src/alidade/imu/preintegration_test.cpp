#include "alidade/imu/preintegration.h"

#include <gtest/gtest.h>

#include "alidade/simulate/imu/imu_readings.h"

namespace alidade {
namespace {

Rigid3 path_at(double t) {
  return {exp_so3(Eigen::Vector3d(0.4 * std::sin(1.3 * t), 0.3 * std::cos(0.9 * t), 0.5 * std::sin(0.7 * t + 0.3))),
          {0.3 * std::sin(2.1 * t), 0.2 * std::cos(1.7 * t), 0.25 * std::sin(1.1 * t)}};
}

ImuScene exact() {
  ImuScene scene;
  scene.mounting.cam_from_imu = {};
  scene.noise = {.rate_density = 0.0, .force_density = 0.0, .rate_walk = 0.0, .force_walk = 0.0};
  return scene;
}

const Eigen::Vector3d zero = Eigen::Vector3d::Zero();

/// Against the path itself: p + v Δ + ½ g Δ² + R p_step. By means between readings 5 ms apart the error is of their
/// square.
TEST(Preintegration, SaysWhereThePathGoes) {
  const ImuScene scene = exact();
  const ImuSequence imu = simulate_imu(scene, path_at, 0.0, 2.0, 1);
  int num = 0;
  for (double from_s = 0.0123; from_s < 1.5; from_s += 0.1, ++num) {
    const double dt_s = 0.2177, to_s = from_s + dt_s, h = 1e-5;
    const auto step = preintegrated(imu.readings, from_s, to_s, 0.02, scene.rate_bias, scene.force_bias);
    ASSERT_TRUE(step);
    const Rigid3 a = path_at(from_s), b = path_at(to_s);
    const auto velocity = [&](double t) {
      return Eigen::Vector3d((path_at(t + h).translation - path_at(t - h).translation) / (2.0 * h));
    };
    EXPECT_NEAR(step->dt_s, dt_s, 1e-12);
    EXPECT_LT(log_so3(step->rotation.conjugate() * a.rotation.conjugate() * b.rotation).norm(), 1e-5);
    const Eigen::Vector3d g = scene.gravity_in_world;
    EXPECT_LT((velocity(from_s) + dt_s * g + a.rotation * step->velocity - velocity(to_s)).norm(), 1e-4);
    EXPECT_LT(
        (a.translation + dt_s * velocity(from_s) + 0.5 * dt_s * dt_s * g + a.rotation * step->position - b.translation)
            .norm(),
        1e-5);
  }
  EXPECT_EQ(num, 15);
}

TEST(Preintegration, ItsDerivativesAreThoseOfDifferences) {
  const ImuSequence imu = simulate_imu(exact(), path_at, 0.0, 2.0, 1);
  constexpr double from_s = 0.5123, to_s = 0.8, h = 1e-5;
  const auto at = [&](const Eigen::Vector3d& rate, const Eigen::Vector3d& force, double late_s) {
    return *preintegrated(imu.readings, from_s + late_s, to_s + late_s, 0.02, rate, force);
  };
  const ImuStep step = at(zero, zero, 0.0);
  const auto off = [&](const Eigen::Quaterniond& q) { return log_so3(step.rotation.conjugate() * q); };
  for (int i = 0; i < 3; ++i) {
    const Eigen::Vector3d d = h * Eigen::Vector3d::Unit(i);
    const ImuStep up = at(d, zero, 0.0), down = at(-d, zero, 0.0);
    EXPECT_LT(((off(up.rotation) - off(down.rotation)) / (2.0 * h) - step.rotation_by_rate.col(i)).norm(), 1e-6);
    EXPECT_LT(((up.velocity - down.velocity) / (2.0 * h) - step.velocity_by_rate.col(i)).norm(), 1e-6);
    EXPECT_LT(((up.position - down.position) / (2.0 * h) - step.position_by_rate.col(i)).norm(), 1e-6);
    const ImuStep more = at(zero, d, 0.0), less = at(zero, -d, 0.0);
    EXPECT_LT(((more.velocity - less.velocity) / (2.0 * h) - step.velocity_by_force.col(i)).norm(), 1e-6);
    EXPECT_LT(((more.position - less.position) / (2.0 * h) - step.position_by_force.col(i)).norm(), 1e-6);
  }
  const ImuStep later = at(zero, zero, h), before = at(zero, zero, -h);
  constexpr double by_means = 2e-3;  // of the integration between readings, by which the derivative is exact
  EXPECT_LT(((off(later.rotation) - off(before.rotation)) / (2.0 * h) - step.rotation_by_time).norm(), by_means);
  EXPECT_LT(((later.velocity - before.velocity) / (2.0 * h) - step.velocity_by_time).norm(), by_means);
  EXPECT_LT(((later.position - before.position) / (2.0 * h) - step.position_by_time).norm(), by_means);
}

TEST(Preintegration, GapsAndTimesOutsideHaveNone) {
  ImuSequence imu = simulate_imu(exact(), path_at, 0.0, 2.0, 1);
  EXPECT_NEAR(usual_period_s(imu.readings), 0.005, 1e-9);
  EXPECT_FALSE(preintegrated(imu.readings, -0.1, 0.1, 0.02, zero, zero));
  EXPECT_FALSE(preintegrated(imu.readings, 1.9, 2.1, 0.02, zero, zero));
  EXPECT_FALSE(preintegrated(imu.readings, 1.0, 1.0, 0.02, zero, zero));
  std::erase_if(imu.readings, [](const ImuReading& each) { return each.t_s > 1.001 && each.t_s < 1.049; });
  EXPECT_FALSE(preintegrated(imu.readings, 0.9, 1.1, 0.02, zero, zero));
  EXPECT_FALSE(preintegrated(imu.readings, 1.01, 1.1, 0.02, zero, zero));
  EXPECT_FALSE(preintegrated(imu.readings, 0.9, 1.02, 0.02, zero, zero));
  EXPECT_FALSE(preintegrated(imu.readings, 1.01, 1.02, 0.02, zero, zero));
  EXPECT_TRUE(preintegrated(imu.readings, 0.9, 1.1, 0.06, zero, zero));
  EXPECT_TRUE(preintegrated(imu.readings, 0.9, 1.0, 0.02, zero, zero));
}

TEST(Preintegration, AFrozenSensorIsAGap) {
  std::vector<ImuReading> readings;
  for (int i = 0; i < 100; ++i) {
    const double value = i >= 40 && i < 70 ? 40.0 : i >= 20 && i < 25 ? 20.0 : i;  // five equal ones are chance
    readings.push_back({0.01 * i, Eigen::Vector3d::Constant(0.1 * value), Eigen::Vector3d::Constant(value)});
  }
  const std::vector<ImuReading> kept = without_frozen(readings);
  ASSERT_EQ(kept.size(), 71u);
  EXPECT_EQ(kept[40].t_s, readings[40].t_s);
  EXPECT_EQ(kept[41].t_s, readings[70].t_s);
  std::vector<ImuReading> at_rest(12, readings[0]);  // without times between them
  EXPECT_EQ(without_frozen(at_rest).size(), 12u);
}

}  // namespace
}  // namespace alidade
