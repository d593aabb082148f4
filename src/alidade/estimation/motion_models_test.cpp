#include "alidade/estimation/motion_models.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <cstdlib>
#include <fstream>
#include <nlohmann/json.hpp>

#include "alidade/estimation/van_loan.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"

namespace alidade {
namespace {

using Json = nlohmann::json;

template <class Model>
Eigen::Vector<double, Model::dim> some_state(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  Eigen::Vector<double, Model::dim> x;
  for (double& value : x) value = normal(rng);
  return x;
}

template <class Model>
Belief<Model::dim> some_belief(std::mt19937_64& rng) {
  std::normal_distribution<double> normal;
  Belief<Model::dim> belief;
  belief.x = some_state<Model>(rng);
  Eigen::Matrix<double, Model::dim, Model::dim> root;
  for (double& value : root.reshaped()) value = normal(rng);
  belief.P = root * root.transpose();
  return belief;
}

template <class Model>
class MotionModels : public ::testing::Test {};
using All = ::testing::Types<ConstantVelocity, MeanReverting, Singer, CoordinatedTurn>;
TYPED_TEST_SUITE(MotionModels, All);

TYPED_TEST(MotionModels, JacobianIsTheDerivativeOfTheTransition) {
  auto rng = testing::make_rng();
  const TypeParam model;
  int checked = 0;
  for (const double scale : {0.0, 1e-6, 1e-2, 1.0, 3.0}) {  // of the turn: none, the series, its edge, far from it
    for (const double dt_s : {0.05, 0.7}) {
      Eigen::Vector<double, TypeParam::dim> x = some_state<TypeParam>(rng);
      x.template tail<3>() *= scale;
      const auto F = model.transition_jacobian(x, dt_s);
      for (int i = 0; i < TypeParam::dim; ++i) {
        const double step = 1e-5;
        Eigen::Vector<double, TypeParam::dim> up = x, down = x;
        up[i] += step;
        down[i] -= step;
        const Eigen::Vector<double, TypeParam::dim> column =
            (model.transition(up, dt_s) - model.transition(down, dt_s)) / (2.0 * step);
        EXPECT_LT((F.col(i) - column).cwiseAbs().maxCoeff(), 1e-9) << "scale " << scale << " column " << i;
        ++checked;
      }
    }
  }
  EXPECT_EQ(checked, 10 * TypeParam::dim);
}

TYPED_TEST(MotionModels, TwoShortPredictionsAreOneLongOne) {
  auto rng = testing::make_rng();
  const TypeParam model;
  const auto x = some_state<TypeParam>(rng);
  EXPECT_LT((model.transition(model.transition(x, 0.3), 0.2) - model.transition(x, 0.5)).norm(), 1e-12);
}

TYPED_TEST(MotionModels, PredictedBeliefIsSymmetricAndHasFAndQ) {
  auto rng = testing::make_rng();
  const TypeParam model;
  for (int trial = 0; trial < 20; ++trial) {
    const auto belief = some_belief<TypeParam>(rng);
    const auto next = model.predicted(belief, 0.13);
    const auto F = model.transition_jacobian(belief.x, 0.13);
    const auto P = (F * belief.P * F.transpose() + model.noise(0.13)).eval();
    EXPECT_LT((next.P - P).norm(), 1e-12 * P.norm());
    EXPECT_LT((next.P - next.P.transpose()).norm(), 1e-15 * P.norm());
    EXPECT_LT((next.x - model.transition(belief.x, 0.13)).norm(), 1e-14);
  }
}

/// ∫ Φ D Φᵀ by Simpson's rule, Φ by 2000 small steps of the series.
template <int N>
Eigen::Matrix<double, N, N> integrated_noise(const Eigen::Matrix<double, N, N>& A, const Eigen::Matrix<double, N, N>& D,
                                             double dt_s) {
  constexpr int count = 2000;
  const Eigen::Matrix<double, N, N> hA = A * (dt_s / count);
  const Eigen::Matrix<double, N, N> step =
      Eigen::Matrix<double, N, N>::Identity() + hA + hA * hA / 2.0 + hA * hA * hA / 6.0 + hA * hA * hA * hA / 24.0;
  Eigen::Matrix<double, N, N> phi = Eigen::Matrix<double, N, N>::Identity(), sum = Eigen::Matrix<double, N, N>::Zero();
  for (int k = 0; k <= count; ++k) {
    const double weight = k == 0 || k == count ? 1.0 : k % 2 == 1 ? 4.0 : 2.0;
    sum += weight * phi * D * phi.transpose();
    phi = (step * phi).eval();
  }
  return sum * (dt_s / count / 3.0);
}

TEST(VanLoan, IsTheIntegralOfTheNoise) {
  Eigen::Matrix3d A, D = Eigen::Matrix3d::Zero();
  A << 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.3, 0.0, -2.0;
  D(2, 2) = 4.0;
  for (const double dt_s : {0.05, 1.0, 4.0}) {
    const Eigen::Matrix3d expected = integrated_noise<3>(A, D, dt_s);
    EXPECT_LT((discretised<3>(A, D, dt_s).Q - expected).norm(), 1e-9 * expected.norm()) << dt_s;
  }
}

TEST(MotionModels, LongRunsHoldTheirStationarySigma) {
  const MeanReverting resting{0.9, 0.7};
  EXPECT_NEAR(resting.noise(50.0)(3, 3), 0.81, 1e-9);
  const Singer singer{2.0, 0.5};
  EXPECT_NEAR(singer.noise(50.0)(8, 8), 4.0, 1e-9);
}

TEST(CoordinatedTurn, GoesRoundACircle) {
  const CoordinatedTurn model;
  Eigen::Vector<double, 9> x;
  x << 0.0, 0.0, 0.0, 2.0, 0.0, 0.0, 0.0, 0.0, 4.0;  // 2 m/s turning at 4 rad/s about z: radius 0.5 m
  const double quarter_s = std::acos(0.0) / 4.0;
  const auto after = model.transition(x, quarter_s);
  EXPECT_LT((after.head<3>() - Eigen::Vector3d(0.5, 0.5, 0.0)).norm(), 1e-12);
  EXPECT_LT((after.segment<3>(3) - Eigen::Vector3d(0.0, 2.0, 0.0)).norm(), 1e-12);
}

template <int N>
Eigen::Matrix<double, N, N> matrix_of(const Json& rows) {
  Eigen::Matrix<double, N, N> result;
  for (int i = 0; i < N; ++i) {
    for (int j = 0; j < N; ++j) result(i, j) = rows[static_cast<std::size_t>(i)][static_cast<std::size_t>(j)];
  }
  return result;
}

TEST(MotionModels, AgreeWithTheReferenceCase) {
  const Json given = Json::parse(std::ifstream(testing::reference_case("c4_ekf_update.json")));
  const double tolerance = given["tol"];
  const ConstantVelocity steady{given["cv"]["sigma_a"]};
  const double dt_s = given["cv"]["dt"];
  EXPECT_LT((steady.transition_jacobian({}, dt_s) - matrix_of<6>(given["cv"]["F"])).norm(), tolerance);
  EXPECT_LT((steady.noise(dt_s) - matrix_of<6>(given["cv"]["Q"])).norm(), tolerance * 1e-3);
  const Singer singer{given["singer"]["sigma_a"], given["singer"]["tau"]};
  EXPECT_LT((singer.transition_jacobian({}, dt_s) - matrix_of<9>(given["singer"]["F"])).norm(), tolerance);
  EXPECT_LT((singer.noise(dt_s) - matrix_of<9>(given["singer"]["Q"])).norm(), tolerance);
}

}  // namespace
}  // namespace alidade
