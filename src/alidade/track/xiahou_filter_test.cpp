#include "alidade/track/xiahou_filter.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <cmath>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "alidade/geometry/decompositions.h"
#include "alidade/simulate/draws.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

const Eigen::Vector3d start_cm(17.3, -31.4, 63.6);

Eigen::Vector3d on_circle_cm(double radius_cm, double t_s) {
  const double angle = 2.0 * std::acos(-1.0) * t_s / 10.0;
  return start_cm + radius_cm * Eigen::Vector3d(std::cos(angle) - 1.0, std::sin(angle), 0.0);
}

TEST(XiahouFilter, FollowsTheReferenceStepByStep) {
  const Json given = Json::parse(std::ifstream(testing::reference_case("c3_paper_ekf.json")));
  const double tolerance = given["tol"];
  XiahouFilter filter({.baseline_cm = 50.2}, start_cm);
  for (const Json& step : given["steps"]) {
    const std::vector<double> z = step["z"];
    filter.step(Eigen::Vector4d(z.data()), 0.05);
    for (int i = 0; i < 6; ++i) {
      EXPECT_NEAR(filter.state().x[i], step["X"][static_cast<std::size_t>(i)], tolerance);
      EXPECT_NEAR(filter.state().P(i, i), step["diagP"][static_cast<std::size_t>(i)], tolerance);
    }
  }
  EXPECT_EQ(given["steps"].size(), 5u);
}

struct Errors {
  double mean_cm, nees;
};

/// The paper's experiment: noise of variance 0.01 on k1..k4 themselves, 200 steps of 0.05 s.
Errors experiment(const XiahouConfig& config, double radius_cm, int runs) {
  double sum = 0.0, sum_nees = 0.0;
  for (int run = 0; run < runs; ++run) {
    Draws draws(static_cast<std::uint64_t>(run) + 1);
    XiahouFilter filter(config, start_cm);
    for (int k = 1; k <= 200; ++k) {
      const Eigen::Vector3d p = on_circle_cm(radius_cm, 0.05 * k);
      Eigen::Vector4d z(p.x() / p.z(), (config.baseline_cm - p.x()) / p.z(), -p.y(), -p.y());
      for (double& value : z) value += 0.1 * draws.normal();
      filter.step(z, 0.05);
      const Eigen::Vector3d error = filter.position_cm() - p;
      Eigen::Matrix3d P;
      for (int i = 0; i < 3; ++i) {
        for (int j = 0; j < 3; ++j) P(i, j) = filter.state().P(2 * i, 2 * j);
      }
      sum += error.norm();
      sum_nees += squared_mahalanobis(error, P);
    }
  }
  return {sum / (200.0 * runs), sum_nees / (200.0 * runs)};
}

TEST(XiahouFilter, LiteralReadingsGiveThePapersError) {
  const Errors literal = experiment({.baseline_cm = 50.2}, 10.0, 400);
  EXPECT_NEAR(literal.mean_cm, 3.13, 0.15);  // the paper prints 3.15
  EXPECT_NEAR(literal.nees / 3.0, 0.75, 0.08);
  const Errors by_acceleration = experiment({.baseline_cm = 50.2, .process_by_acceleration = true}, 6.0, 400);
  EXPECT_NEAR(by_acceleration.mean_cm, 3.02, 0.15);
  EXPECT_NEAR(by_acceleration.nees, 24.0, 2.0);  // of 3: it is far too sure
}

TEST(PseudoMeasurement, IsWhereTwoUnturnedHeadsPoint) {
  const auto rig = xiahou_rig();
  const Eigen::Vector3d point(0.17, -0.31, 0.64);
  const auto first = aim(rig[0].head, point), second = aim(rig[1].head, point);
  ASSERT_TRUE(first && second);
  const auto k = pseudo_measurement(*first, *second, 50.0);
  ASSERT_TRUE(k);
  EXPECT_LT((position_of_pseudo_measurement(*k, 50.0) - 100.0 * point).norm(), 1e-9);
  EXPECT_NEAR((*k)[2], (*k)[3], 1e-9);
  EXPECT_FALSE(pseudo_measurement({0.1, 0.0}, {0.1, 0.0}, 50.0));
}

}  // namespace
}  // namespace alidade
