#include "alidade/geometry/rigid3.h"

#include <gtest/gtest.h>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

struct Draw {
  std::mt19937_64 rng = testing::make_rng();
  std::normal_distribution<> standard;
  Eigen::Vector3d vector() { return {standard(rng), standard(rng), standard(rng)}; }
  Rigid3 motion() { return {exp_so3(vector()), vector()}; }
};

double distance(const Rigid3& a, const Rigid3& b) {
  return (a.translation - b.translation).norm() + log_so3(a.rotation.conjugate() * b.rotation).norm();
}

TEST(Rigid3, IsAGroupThatActsOnPoints) {
  Draw draw;
  for (int i = 0; i < 500; ++i) {
    const Rigid3 b_from_a = draw.motion(), c_from_b = draw.motion(), d_from_c = draw.motion();
    const Eigen::Vector3d point_in_a = draw.vector();
    EXPECT_LT(((c_from_b * b_from_a) * point_in_a - c_from_b * (b_from_a * point_in_a)).norm(), 1e-13);
    EXPECT_LT(distance((d_from_c * c_from_b) * b_from_a, d_from_c * (c_from_b * b_from_a)), 1e-13);
    EXPECT_LT(distance(b_from_a.inverse() * b_from_a, Rigid3{}), 1e-13);
    EXPECT_LT(distance(b_from_a * b_from_a.inverse(), Rigid3{}), 1e-13);
    EXPECT_LT((b_from_a.inverse() * (b_from_a * point_in_a) - point_in_a).norm(), 1e-13);
  }
}

TEST(Rigid3, RetractPerturbsOnTheRight) {
  Draw draw;
  for (int i = 0; i < 500; ++i) {
    const Rigid3 b_from_a = draw.motion();
    Eigen::Vector<double, 6> xi;
    xi << 0.1 * draw.vector(), 0.1 * draw.vector();
    const Rigid3 step{exp_so3(xi.tail<3>()), xi.head<3>()};
    EXPECT_LT(distance(b_from_a.retract(xi), b_from_a * step), 1e-13);
  }
}

TEST(Rigid3, RotationStaysUnitAfterManyProducts) {
  Draw draw;
  Rigid3 b_from_a;
  const Rigid3 step = draw.motion();
  for (int i = 0; i < 100000; ++i) b_from_a = step * b_from_a;
  EXPECT_NEAR(b_from_a.rotation.norm(), 1.0, 1e-15);
}

}  // namespace
}  // namespace alidade
