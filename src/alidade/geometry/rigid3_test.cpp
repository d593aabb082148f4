#include "alidade/geometry/rigid3.h"

#include <gtest/gtest.h>

#include <numbers>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

constexpr double epsilon = 1e-13;  // a few roundings of numbers of size one
constexpr int num_cases = 500;

Eigen::Vector3d random_vector(std::mt19937_64& rng, double size) {
  std::uniform_real_distribution<double> uniform(-size, size);
  return {uniform(rng), uniform(rng), uniform(rng)};
}

Rigid3 random_motion(std::mt19937_64& rng) { return {exp_so3(random_vector(rng, 2.0)), random_vector(rng, 1.0)}; }

double difference(const Rigid3& a, const Rigid3& b) {
  return (a.rotation.toRotationMatrix() - b.rotation.toRotationMatrix()).norm() +
         (a.translation - b.translation).norm();
}

TEST(So3, LogUndoesExpUpToHalfATurn) {
  std::mt19937_64 rng = testing::make_rng();
  int num_checked = 0;
  for (const double angle : {0.0, 1e-300, 1e-12, 1e-7, 1e-6, 1e-3, 1.0, 3.0, std::numbers::pi - 1e-6}) {
    for (int i = 0; i < 50; ++i, ++num_checked) {
      const Eigen::Vector3d phi = angle * random_vector(rng, 1.0).normalized();
      // Near a half turn the quaternion's w is nearly 0 and its angle loses nothing: atan2, not acos.
      EXPECT_LE((log_so3(exp_so3(phi)) - phi).norm(), epsilon * std::max(1.0, angle)) << angle;
    }
  }
  EXPECT_EQ(num_checked, 450);
}

TEST(So3, ExpIsTheMatrixExponential) {
  std::mt19937_64 rng = testing::make_rng();
  for (int i = 0; i < num_cases; ++i) {
    const Eigen::Vector3d phi = random_vector(rng, 1.8);
    Eigen::Matrix3d term = Eigen::Matrix3d::Identity(), sum = term;
    for (int n = 1; n < 40; ++n) {  // 3^40/40! < 1e-28
      term = term * cross_matrix(phi) / n;
      sum += term;
    }
    ASSERT_LE((exp_so3(phi).toRotationMatrix() - sum).norm(), 1e-12);
  }
}

TEST(So3, OppositeQuaternionsAreOneRotation) {
  const Eigen::Quaterniond q = exp_so3({0.3, -0.2, 0.5});
  const Eigen::Quaterniond minus_q(-q.w(), -q.x(), -q.y(), -q.z());
  EXPECT_LE((log_so3(q) - log_so3(minus_q)).norm(), epsilon);
}

TEST(So3, CrossMatrixIsTheCrossProduct) {
  const Eigen::Vector3d v(1.0, -2.0, 3.0), w(0.5, 4.0, -1.0);
  EXPECT_EQ(cross_matrix(v) * w, v.cross(w));
}

TEST(Rigid3, KnownMotionMovesAKnownPoint) {
  // By hand: a quarter turn about z takes x to y; then 1 m along x.
  const Rigid3 cam_from_board{exp_so3({0.0, 0.0, 0.5 * std::numbers::pi}), {1.0, 0.0, 0.0}};
  const Eigen::Vector3d point_in_board(2.0, 0.0, 3.0);
  EXPECT_LE((cam_from_board * point_in_board - Eigen::Vector3d(1.0, 2.0, 3.0)).norm(), epsilon);
}

TEST(Rigid3, MotionsAreAGroupThatActsOnPoints) {
  std::mt19937_64 rng = testing::make_rng();
  for (int i = 0; i < num_cases; ++i) {
    const Rigid3 world_from_base = random_motion(rng), base_from_cam = random_motion(rng),
                 cam_from_board = random_motion(rng);
    const Eigen::Vector3d point_in_board = random_vector(rng, 1.0);
    const Rigid3 world_from_cam = world_from_base * base_from_cam;
    const Rigid3 base_from_board = base_from_cam * cam_from_board;
    ASSERT_LE(difference(world_from_cam * cam_from_board, world_from_base * base_from_board), epsilon);
    ASSERT_LE(difference(base_from_cam * base_from_cam.inverse(), {}), epsilon);
    const Eigen::Vector3d point_in_cam = cam_from_board * point_in_board;
    ASSERT_LE((base_from_board * point_in_board - base_from_cam * point_in_cam).norm(), epsilon);
  }
}

TEST(Rigid3, RetractIsThePerturbationOnTheRight) {
  std::mt19937_64 rng = testing::make_rng();
  for (int i = 0; i < num_cases; ++i) {
    const Rigid3 cam_from_board = random_motion(rng);
    Eigen::Vector<double, 6> xi;
    xi << random_vector(rng, 0.1), random_vector(rng, 0.1);
    const Rigid3 step{exp_so3(xi.tail<3>()), xi.head<3>()};  // T Exp(ξ), its translation taken as it stands
    ASSERT_LE(difference(cam_from_board.retract(xi), cam_from_board * step), epsilon);
  }
}

}  // namespace
}  // namespace alidade
