#include "alidade/geometry/so3.h"

#include <gtest/gtest.h>

#include <numbers>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

Eigen::Vector3d random_rotation_vector(std::mt19937_64& rng, double angle_rad) {
  std::normal_distribution<> standard;
  return angle_rad * Eigen::Vector3d(standard(rng), standard(rng), standard(rng)).normalized();
}

TEST(So3, ExpIsTheRotationByThatAngleAboutThatAxis) {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> angle(0.0, 6.0);
  for (int i = 0; i < 1000; ++i) {
    const Eigen::Vector3d phi = random_rotation_vector(rng, angle(rng));
    const Eigen::Matrix3d reference = Eigen::AngleAxisd(phi.norm(), phi.normalized()).toRotationMatrix();
    EXPECT_LT((exp_so3(phi).toRotationMatrix() - reference).norm(), 1e-14);
  }
}

TEST(So3, LogInvertsExpUpToPi) {
  auto rng = testing::make_rng();
  for (const double angle_rad : {0.0, 1e-300, 1e-12, 1e-9, 1e-7, 1e-6, 1e-5, 0.1, 1.0, 3.0, std::numbers::pi - 1e-9}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d phi = random_rotation_vector(rng, angle_rad);
      const Eigen::Quaterniond q = exp_so3(phi);
      EXPECT_NEAR(q.norm(), 1.0, 1e-15);
      EXPECT_LT((log_so3(q) - phi).norm(), 1e-15 + 1e-14 * angle_rad);
      EXPECT_LT((log_so3(Eigen::Quaterniond(-q.coeffs())) - phi).norm(), 1e-15 + 1e-14 * angle_rad);
    }
  }
}

TEST(So3, RotationBetweenIsTheShortestThatTurnsOneIntoTheOther) {
  auto rng = testing::make_rng();
  for (const double angle_rad : {0.0, 1e-12, 1e-7, 1e-3, 0.5, 1.5, 3.0, std::numbers::pi - 1e-5, std::numbers::pi}) {
    for (int i = 0; i < 100; ++i) {
      const Eigen::Vector3d from = random_rotation_vector(rng, 2.0);
      const Eigen::Vector3d axis = from.cross(random_rotation_vector(rng, 1.0)).normalized();
      const Eigen::Vector3d to = Eigen::AngleAxisd(angle_rad, axis) * (0.3 * from);
      const Eigen::Quaterniond q = rotation_between(from, to);
      EXPECT_NEAR(q.norm(), 1.0, 1e-15);
      EXPECT_LT((q * from.normalized() - to.normalized()).norm(), 2e-15) << angle_rad;
      EXPECT_NEAR(log_so3(q).norm(), angle_rad, 4e-8) << angle_rad;  // rounding of `to` turns an angle near π
    }
  }
  const Eigen::Quaterniond half = rotation_between(Eigen::Vector3d::UnitX(), -Eigen::Vector3d::UnitX());
  EXPECT_LT((half * Eigen::Vector3d::UnitX() + Eigen::Vector3d::UnitX()).norm(), 1e-15);
}

TEST(So3, CrossMatrixIsTheCrossProductAndTheDerivativeOfExp) {
  auto rng = testing::make_rng();
  for (int i = 0; i < 100; ++i) {
    const Eigen::Vector3d v = random_rotation_vector(rng, 2.0), w = random_rotation_vector(rng, 1.0);
    EXPECT_LT((cross_matrix(v) * w - v.cross(w)).norm(), 1e-15);
    const Eigen::Vector3d numeric = (exp_so3(1e-6 * v) * w - exp_so3(-1e-6 * v) * w) / 2e-6;
    EXPECT_LT((numeric - v.cross(w)).norm(), 1e-9);  // truncation 1e-12, rounding 1e-10
  }
}

}  // namespace
}  // namespace alidade
