#include "alidade/localize/camera_motion.h"

#include <gtest/gtest.h>

#include <cstdlib>
#include <nlohmann/json.hpp>

#include "alidade/files/files.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using Json = nlohmann::json;
using Error = Eigen::Vector<double, motion_dim>;

CameraMotion random_motion(std::mt19937_64& rng, double turn) {
  std::normal_distribution<double> normal;
  const auto vector = [&] {
    const double x = normal(rng), y = normal(rng), z = normal(rng);
    return Eigen::Vector3d(x, y, z);
  };
  return {{exp_so3(turn * vector()), vector()}, vector(), turn * vector()};
}

Error difference(const CameraMotion& to, const CameraMotion& from) {
  Error error;
  error << to.world_from_cam.translation - from.world_from_cam.translation,
      log_so3(from.world_from_cam.rotation.conjugate() * to.world_from_cam.rotation),
      to.velocity_in_world - from.velocity_in_world, to.rate_in_cam - from.rate_in_cam;
  return error;
}

TEST(CameraMotion, ADifferenceOfPosesIsTheErrorBetweenThem) {
  auto rng = testing::make_rng();
  for (const double turn : {0.0, 1e-7, 1e-3, 0.5}) {
    const CameraMotion from = random_motion(rng, turn);
    Error error = difference(random_motion(rng, turn), CameraMotion());
    error.tail<6>().setZero();
    const CameraMotion to = retract(from, error);
    EXPECT_LT((pose_difference(to.world_from_cam, from.world_from_cam) - error.head<6>()).norm(), 1e-9) << turn;
  }
}

TEST(CameraMotion, JacobiansAreThoseOfCentralDifferences) {
  auto rng = testing::make_rng();
  int num_cases = 0;
  for (const double turn : {0.0, 1e-7, 1e-3, 0.1, 1.0, 3.0}) {
    for (int k = 0; k < 20; ++k, ++num_cases) {
      const CameraMotion motion = random_motion(rng, turn);
      const double dt_s = 0.1;
      const MotionJacobians J = motion_jacobians(motion, dt_s);
      const CameraMotion later = moved(motion, dt_s);
      constexpr double step = 1e-6;
      for (int i = 0; i < motion_dim; ++i) {
        Error e = Error::Zero();
        e[i] = step;
        const Error column =
            (difference(moved(retract(motion, e), dt_s), later) - difference(moved(retract(motion, -e), dt_s), later)) /
            (2.0 * step);
        EXPECT_LT((J.F.col(i) - column).cwiseAbs().maxCoeff(), 1e-8) << turn << " " << i;  // step² and rounding/step
        if (i < 6) continue;  // a step of velocity and rate at the beginning
        EXPECT_LT((J.G.col(i - 6) - column).cwiseAbs().maxCoeff(), 1e-8) << turn << " " << i;
      }
    }
  }
  EXPECT_EQ(num_cases, 120);
}

/// The same motion with 13 numbers, [r, q (wxyz), v, ω], and its F and G by their own formulas: left and right products
/// of quaternions.
struct QuaternionForm {
  Eigen::Matrix<double, 13, 13> F = Eigen::Matrix<double, 13, 13>::Identity();
  Eigen::Matrix<double, 13, 6> G = Eigen::Matrix<double, 13, 6>::Zero();
};

Eigen::Matrix4d left_product(const Eigen::Quaterniond& q) {
  Eigen::Matrix4d L;
  L << q.w(), -q.x(), -q.y(), -q.z(), q.x(), q.w(), -q.z(), q.y(), q.y(), q.z(), q.w(), -q.x(), q.z(), -q.y(), q.x(),
      q.w();
  return L;
}

Eigen::Matrix4d right_product(const Eigen::Quaterniond& q) {
  Eigen::Matrix4d R;
  R << q.w(), -q.x(), -q.y(), -q.z(), q.x(), q.w(), q.z(), -q.y(), q.y(), -q.z(), q.w(), q.x(), q.z(), q.y(), -q.x(),
      q.w();
  return R;
}

QuaternionForm quaternion_form(const CameraMotion& motion, double dt_s) {
  const Eigen::Vector3d phi = motion.rate_in_cam * dt_s;
  const double theta = phi.norm();
  const Eigen::Vector3d axis = phi / theta;
  Eigen::Matrix<double, 4, 3> d_exp;  // of exp(ωΔ) by ω
  d_exp.row(0) = -0.5 * std::sin(0.5 * theta) * axis.transpose();
  d_exp.bottomRows<3>() = std::sin(0.5 * theta) / theta * (Eigen::Matrix3d::Identity() - axis * axis.transpose()) +
                          0.5 * std::cos(0.5 * theta) * axis * axis.transpose();
  const Eigen::Matrix<double, 4, 3> J = left_product(motion.world_from_cam.rotation) * d_exp * dt_s;
  QuaternionForm form;
  form.F.block<3, 3>(0, 7) = dt_s * Eigen::Matrix3d::Identity();
  form.F.block<4, 4>(3, 3) = right_product(exp_so3(phi));
  form.F.block<4, 3>(3, 10) = J;
  form.G.block<3, 3>(0, 0) = dt_s * Eigen::Matrix3d::Identity();
  form.G.block<4, 3>(3, 3) = J;
  form.G.block<3, 3>(7, 0).setIdentity();
  form.G.block<3, 3>(10, 3).setIdentity();
  return form;
}

/// ∂[r, q, v, ω]/∂(error): δq = ½ q ⊗ (0, δθ).
Eigen::Matrix<double, 13, motion_dim> embedding(const Eigen::Quaterniond& q) {
  Eigen::Matrix<double, 13, motion_dim> E = Eigen::Matrix<double, 13, motion_dim>::Zero();
  E.topLeftCorner<3, 3>().setIdentity();
  E.block<4, 3>(3, 3) = 0.5 * left_product(q).rightCols<3>();
  E.bottomRightCorner<6, 6>().setIdentity();
  return E;
}

TEST(CameraMotion, ErrorStateAndQuaternionFormsAgree) {
  auto rng = testing::make_rng();
  for (int k = 0; k < 50; ++k) {
    const CameraMotion motion = random_motion(rng, 0.7);
    const double dt_s = 0.1;
    const MotionJacobians J = motion_jacobians(motion, dt_s);
    const QuaternionForm form = quaternion_form(motion, dt_s);
    const auto before = embedding(motion.world_from_cam.rotation);
    const auto after = embedding(moved(motion, dt_s).world_from_cam.rotation);
    EXPECT_LT((form.F * before - after * J.F).cwiseAbs().maxCoeff(), 1e-13);  // rounding
    EXPECT_LT((form.G - after * J.G).cwiseAbs().maxCoeff(), 1e-13);
  }
}

template <int Rows, int Cols>
Eigen::Matrix<double, Rows, Cols> matrix_of(const Json& rows) {
  Eigen::Matrix<double, Rows, Cols> matrix;
  for (int i = 0; i < Rows; ++i)
    for (int j = 0; j < Cols; ++j) matrix(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  return matrix;
}

TEST(CameraMotion, IsThatOfTheReferenceCasesInBothForms) {
  const Json file = Json::parse(read_file(testing::reference_case("d2_motion_measurement.json")));
  const double tolerance = file["tol"];
  for (const Json& row : file["rows"]) {
    const std::vector<double> x = row["x"], next = row["x_next"];
    const CameraMotion motion{
        {Eigen::Quaterniond(x[3], x[4], x[5], x[6]), {x[0], x[1], x[2]}}, {x[7], x[8], x[9]}, {x[10], x[11], x[12]}};
    const double dt_s = row["dt"];
    const CameraMotion later = moved(motion, dt_s);
    const MotionJacobians J = motion_jacobians(motion, dt_s);
    const QuaternionForm form = quaternion_form(motion, dt_s);
    for (int i = 0; i < 3; ++i)
      EXPECT_NEAR(later.world_from_cam.translation[i], next[static_cast<std::size_t>(i)], tolerance);
    const Eigen::Quaterniond q(next[3], next[4], next[5], next[6]);
    EXPECT_LT(later.world_from_cam.rotation.angularDistance(q), 10 * tolerance);
    EXPECT_LT((J.F - matrix_of<12, 12>(row["F_es"])).cwiseAbs().maxCoeff(), tolerance);
    EXPECT_LT((J.G - matrix_of<12, 6>(row["G_es"])).cwiseAbs().maxCoeff(), tolerance);
    EXPECT_LT((form.F - matrix_of<13, 13>(row["F"])).cwiseAbs().maxCoeff(), tolerance);
    EXPECT_LT((form.G - matrix_of<13, 6>(row["G"])).cwiseAbs().maxCoeff(), tolerance);
  }
}

}  // namespace
}  // namespace alidade
