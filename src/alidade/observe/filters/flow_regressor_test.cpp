#include "alidade/observe/filters/flow_regressor.h"

#include <gtest/gtest.h>

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <fstream>
#include <nlohmann/json.hpp>

#include "alidade/geometry/decompositions.h"
#include "alidade/geometry/so3.h"
#include "alidade/observe/filters/running_gramian.h"
#include "alidade/testing/random.h"
#include "alidade/testing/reference_case.h"
#include "alidade/testing/rotation_sample.h"

namespace alidade {
namespace {

using testing::paper_case;
using testing::paper_scale;

/// Where a point that is seen at q now is seen once the camera has rotated with constant ω for `t_s`: by the projection
/// itself, which knows nothing of Θ.
Eigen::Vector2d seen_after(const Eigen::Vector4d& k, const Eigen::Vector2d& q, const Eigen::Vector3d& rate,
                           double t_s) {
  const Eigen::Vector3d ray((q.x() - k[2]) / k[0], (q.y() - k[3]) / k[1], 1.0);
  const Eigen::Vector3d turned = exp_so3(-rate * t_s) * ray;
  return {k[0] * turned.x() / turned.z() + k[2], k[1] * turned.y() / turned.z() + k[3]};
}

/// q̇ by differences of fourth order. With h = 1 ms their error is h⁴/30 of a fifth derivative below 10: 10⁻¹², and
/// rounding 10⁻¹⁶/h.
Eigen::Vector2d flow_by_differences(const Eigen::Vector4d& k, const Eigen::Vector2d& q, const Eigen::Vector3d& rate) {
  const double h = 1e-3;
  const auto at = [&](double t_s) { return seen_after(k, q, rate, t_s); };
  return (8.0 * (at(h) - at(-h)) - (at(2.0 * h) - at(-2.0 * h))) / (12.0 * h);
}

constexpr double difference_tolerance = 1e-11;

struct RandomFlow {
  Eigen::Vector4d k;
  Eigen::Vector2d q, q_reference;
  Eigen::Vector3d rate;
};

std::vector<RandomFlow> random_flows() {
  auto rng = testing::make_rng();
  std::uniform_real_distribution<> unit(-1.0, 1.0);
  std::vector<RandomFlow> flows;
  for (int i = 0; i < 200; ++i) {
    flows.push_back({{1.75 + 0.7 * unit(rng), 1.75 + 0.7 * unit(rng), 0.3 * unit(rng), 0.3 * unit(rng)},
                     {unit(rng), unit(rng)},
                     {unit(rng), unit(rng)},
                     {0.3 * unit(rng), 0.3 * unit(rng), 0.3 * unit(rng)}});
  }
  return flows;
}

TEST(FlowRegressor, IsTheFlowOfATurningCamera) {
  for (const RandomFlow& f : random_flows()) {
    const Eigen::Vector2d flow = flow_regressor(f.q, f.rate).transpose() * flow_parameters(f.k);
    EXPECT_LT((flow - flow_by_differences(f.k, f.q, f.rate)).norm(), difference_tolerance);
  }
}

TEST(FlowRegressor, OfADifferenceIsTheDifferenceOfFlows) {
  for (const RandomFlow& f : random_flows()) {
    const Eigen::Vector2d flow =
        difference_regressor(f.q, f.q_reference, f.rate).transpose() * difference_parameters(f.k);
    const Eigen::Vector2d expected =
        flow_by_differences(f.k, f.q, f.rate) - flow_by_differences(f.k, f.q_reference, f.rate);
    EXPECT_LT((flow - expected).norm(), 2.0 * difference_tolerance);
  }
}

TEST(FlowParameters, DerivativesAreThoseOfDifferences) {
  const double h = 1e-5;  // error h² of a third derivative below 100, and 10⁻¹⁶/h
  for (const RandomFlow& f : random_flows()) {
    const auto flow_j = flow_parameters_jacobian(f.k);
    const auto difference_j = difference_parameters_jacobian(f.k);
    const DifferenceParameters theta = difference_parameters(f.k);
    const auto inverse_j = intrinsics_jacobian(theta);
    for (Eigen::Index i = 0; i < 4; ++i) {
      const Eigen::Vector4d dk = h * Eigen::Vector4d::Unit(i);
      EXPECT_LT((flow_j.col(i) - (flow_parameters(f.k + dk) - flow_parameters(f.k - dk)) / (2.0 * h)).norm(), 1e-8);
      EXPECT_LT((difference_j.col(i) - (difference_parameters(f.k + dk) - difference_parameters(f.k - dk)) / (2.0 * h))
                    .norm(),
                1e-8);
    }
    for (Eigen::Index i = 0; i < 8; ++i) {
      const DifferenceParameters dt = h * DifferenceParameters::Unit(i);
      const Eigen::Vector4d by_differences =
          (*intrinsics_of(theta + dt, 0.0) - *intrinsics_of(theta - dt, 0.0)) / (2.0 * h);
      EXPECT_LT((inverse_j.col(i) - by_differences).norm(), 1e-7);
    }
  }
}

TEST(FlowParameters, GiveTheIntrinsicsBack) {
  for (const RandomFlow& f : random_flows()) {
    const auto k = intrinsics_of(difference_parameters(f.k), 0.05);
    ASSERT_TRUE(k);
    EXPECT_LT((*k - f.k).norm(), 1e-14);
  }
  const Eigen::Vector4d px(710.0, 700.0, 390.0, 290.0);
  EXPECT_LT((intrinsics_in_px(paper_scale, scaled_intrinsics(paper_scale, px)) - px).norm(), 1e-12);
}

TEST(FlowParameters, GiveNoIntrinsicsOnTheWayThroughInfinity) {
  DifferenceParameters theta = difference_parameters({1.75, 1.75, 0.0, 0.0});
  theta[0] = 0.04;
  EXPECT_FALSE(intrinsics_of(theta, 0.05));
  theta[0] = -0.5;
  EXPECT_FALSE(intrinsics_of(theta, 0.05));
  theta[0] = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(intrinsics_of(theta, 0.05));
}

// --- the running Gramian --------------------------------------------------------------------------------------------

TEST(RunningGramian, IsOfTheLastEightSeconds) {
  RunningGramian gramian;
  RunningGramian::Matrix one = RunningGramian::Matrix::Identity();
  for (int i = 0; i < 600; ++i) gramian.add(one, 1.0 / 30.0);
  const double bin_s = 0.25 + 1.0 / 30.0;  // a step belongs to the bin in which it ends
  EXPECT_NEAR(gramian.lambda_min(), 8.0, bin_s);
  for (int i = 0; i < 241; ++i) gramian.add(2.0 * one, 1.0 / 30.0);
  EXPECT_NEAR(gramian.lambda_min(), 16.0, 2.0 * bin_s);
  gramian.add(0.0 * one, 100.0);
  EXPECT_EQ(gramian.lambda_min(), 0.0);
}

TEST(RunningGramian, LeavesOutWhatATurnAboutTheViewExplains) {
  RunningGramian gramian;
  RunningGramian::Matrix omega2 = RunningGramian::Matrix::Identity();
  omega2(4, 6) = omega2(6, 4) = 1.0;  // ω_z that goes with ω_x: θ5 and fx/fy in one
  gramian.add(omega2, 1.0);
  EXPECT_NEAR(gramian.lambda_min(), 0.0, 1e-15);
}

// --- the reference cases --------------------------------------------------------------------------------------------

nlohmann::json read_case(const std::string& name) {
  return nlohmann::json::parse(std::ifstream(testing::reference_case(name)));
}

TEST(FlowRegressorCase, AgreesWithTheReference) {
  const nlohmann::json reference = read_case("a_regressor.json");
  const double tolerance = reference["tol"];
  const Eigen::Vector3d rate(reference["omega"][0], reference["omega"][1], 0.0);
  const auto q = [&](std::size_t i) {
    return paper_scale.normalised({reference["pixels"][i][0].get<double>(), reference["pixels"][i][1].get<double>()});
  };
  for (std::size_t i = 0; i < 4; ++i) {
    const FlowRegressor full = flow_regressor(q(i), rate);
    const DifferenceRegressor difference = difference_regressor(q(i), q(0), rate);
    for (std::size_t axis = 0; axis < 2; ++axis) {
      const auto a = static_cast<Eigen::Index>(axis);
      for (std::size_t row = 0; row < 10; ++row) {
        const double expected = reference["G"][row][2 * i + axis];
        EXPECT_NEAR(full(static_cast<Eigen::Index>(row), a), expected, tolerance * std::abs(expected) + 1e-17);
      }
      for (std::size_t row = 0; row < 6 && i > 0; ++row) {
        const double expected = reference["Omega"][row][2 * (i - 1) + axis];
        // 10⁻¹⁶ more: it is a difference of numbers up to a fifth.
        EXPECT_NEAR(difference(static_cast<Eigen::Index>(row), a), expected, tolerance * std::abs(expected) + 1e-16);
      }
    }
  }
}

TEST(FlowRegressorCase, GramianAgreesWithTheReference) {
  const nlohmann::json reference = read_case("a_gramian.json");
  const std::optional<RotationLog> log = paper_case("a_clean");
  Eigen::Matrix<double, 8, 8> gramian = Eigen::Matrix<double, 8, 8>::Zero();
  for (std::size_t r = 0; r < 236; ++r) {
    const RotationRow& row = log->rows[r];
    for (std::size_t i = 1; i < 4; ++i) {
      const DifferenceRegressor omega = difference_regressor(paper_scale.normalised(row.px[i]),
                                                             paper_scale.normalised(row.px[0]), row.rate_rad_per_s);
      gramian += omega * omega.transpose() / 30.0;
    }
  }
  const double tolerance = reference["rtol"];
  for (std::size_t i = 0; i < 6; ++i) {
    for (std::size_t j = 0; j < 6; ++j) {
      const auto row = static_cast<Eigen::Index>(i), col = static_cast<Eigen::Index>(j);
      // Of what the entry sums: one cancels to 10⁻⁴ of that, and the file's pixels have nine digits.
      const double size = std::sqrt(gramian(row, row) * gramian(col, col));
      EXPECT_NEAR(gramian(row, col), reference["gramian"][i][j].get<double>(), tolerance * size);
    }
  }
  const SymmetricEigen eigen = symmetric_eigen(gramian.topLeftCorner<6, 6>());
  for (std::size_t i = 0; i < 6; ++i) {
    const double expected = reference["eig"][i];
    EXPECT_NEAR(eigen.values[static_cast<Eigen::Index>(i)], expected, tolerance * expected);
  }
}

}  // namespace
}  // namespace alidade
