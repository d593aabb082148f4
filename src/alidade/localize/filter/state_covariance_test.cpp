#include "alidade/localize/filter/state_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <cmath>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

constexpr int max_dim = 70;

Eigen::MatrixXd random_covariance(std::mt19937_64& rng, int dim) {
  std::normal_distribution<double> normal;
  Eigen::MatrixXd A(dim, dim);
  for (int i = 0; i < dim; ++i)
    for (int j = 0; j < dim; ++j) A(i, j) = normal(rng);
  const Eigen::MatrixXd P = A * A.transpose() + Eigen::MatrixXd::Identity(dim, dim);
  return 0.5 * (P + P.transpose());
}

Eigen::MatrixXd dense(const StateCovariance& P) {
  Eigen::MatrixXd matrix(P.dim(), P.dim());
  for (int i = 0; i < P.dim(); ++i)
    for (int j = 0; j < P.dim(); ++j) matrix(i, j) = P.at(i, j);
  return matrix;
}

struct Pair {
  std::vector<int> columns;
  std::vector<double> h0, h1;
  [[nodiscard]] StateCovariance::Rows rows() const { return {columns, h0.data(), h1.data()}; }
};

/// Measures pairs in groups and keeps a dense covariance beside it: P − P Hᵀ (H P Hᵀ + I)⁻¹ H P.
TEST(StateCovariance, IsThatOfTheDenseUpdateInAnyGrouping) {
  auto rng = testing::make_rng();
  std::normal_distribution<double> normal;
  int num_updates = 0;
  for (const int dim : {12, 17, 24, 63, max_dim}) {
    StateCovariance P;
    P.reserve(max_dim, 64);
    ASSERT_TRUE(P.grow(dim));
    Eigen::MatrixXd should = random_covariance(rng, dim);
    for (int i = 0; i < dim; ++i)
      for (int j = 0; j < dim; ++j) P.at(i, j) = should(i, j);
    for (const int group : {1, 2, 3, 5}) {
      std::vector<Pair> pairs(static_cast<std::size_t>(group));
      Eigen::MatrixXd H = Eigen::MatrixXd::Zero(2 * group, dim);
      std::vector<StateCovariance::Rows> rows;
      for (int m = 0; m < group; ++m) {
        Pair& pair = pairs[static_cast<std::size_t>(m)];
        for (int c = 0; c < 9; ++c) {
          const int column = c < 6 ? c : 6 + (3 * m + c) % (dim - 6);
          pair.columns.push_back(column);
          pair.h0.push_back(normal(rng));
          pair.h1.push_back(normal(rng));
          H(2 * m, column) += pair.h0.back();
          H(2 * m + 1, column) += pair.h1.back();
        }
        rows.push_back(pair.rows());
      }
      const Eigen::MatrixXd S = H * should * H.transpose() + Eigen::MatrixXd::Identity(2 * group, 2 * group);
      EXPECT_LT((P.innovation_covariance(rows[0]) + Eigen::Matrix2d::Identity() - S.topLeftCorner<2, 2>()).norm(),
                1e-9 * S.norm());
      P.products(rows);
      const Eigen::MatrixXd U = S.llt().matrixU();
      const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor> triangle = U.inverse();
      ASSERT_TRUE(P.append({triangle.data(), static_cast<std::size_t>(triangle.size())}, 2 * group));
      should -= should * H.transpose() * S.inverse() * H * should;
      EXPECT_NEAR(P.current(0, dim - 1), should(0, dim - 1), 1e-9 * should.norm());
      ++num_updates;
    }
    EXPECT_TRUE(P.stays_positive());
    P.commit();
    EXPECT_LT((dense(P) - should).cwiseAbs().maxCoeff(), 1e-9 * should.norm());  // rounding of 22 updates
    EXPECT_EQ((dense(P) - dense(P).transpose()).cwiseAbs().maxCoeff(), 0.0);
  }
  EXPECT_EQ(num_updates, 20);
}

TEST(StateCovariance, KeepsAChangeAsideWhileAnotherIsTried) {
  auto rng = testing::make_rng();
  StateCovariance P;
  P.reserve(max_dim, 8);
  ASSERT_TRUE(P.grow(20));
  const Eigen::MatrixXd start = random_covariance(rng, 20);
  for (int i = 0; i < 20; ++i)
    for (int j = 0; j < 20; ++j) P.at(i, j) = start(i, j);
  const auto measure = [&](int column) {  // the number itself, twice, with unit noise
    const Pair pair{{column}, {1.0}, {0.0}};
    const std::vector<StateCovariance::Rows> rows{pair.rows()};
    P.products(rows);
    const std::vector<double> triangle{1.0 / std::sqrt(P.product_at(column, 0) + 1.0), 0.0, 0.0, 1.0};
    ASSERT_TRUE(P.append(triangle, 2));
  };
  measure(3);
  const double first = P.current(3, 3);
  P.swap_pending();
  EXPECT_EQ(P.num_pending(), 0);
  measure(7);
  EXPECT_NE(P.current(3, 3), first);
  P.swap_pending();
  EXPECT_EQ(P.current(3, 3), first);
  P.commit();
  EXPECT_NEAR(P.at(3, 3), start(3, 3) / (start(3, 3) + 1.0), 1e-12);
  EXPECT_NEAR(P.at(7, 7), start(7, 7) - start(3, 7) * start(3, 7) / (start(3, 3) + 1.0), 1e-12 * start(7, 7));
}

/// B P Bᵀ with blocks of B along its diagonal and numbers between them that stay, against the dense product.
TEST(StateCovariance, TurnsByBlocks) {
  auto rng = testing::make_rng();
  std::normal_distribution<double> normal;
  for (const int num_single : {0, 1, 5}) {
    constexpr int single_at = 12;
    const int dim = 60 + num_single;
    StateCovariance P;
    P.reserve(max_dim, 8);
    ASSERT_TRUE(P.grow(dim));
    const Eigen::MatrixXd start = random_covariance(rng, dim);
    for (int i = 0; i < dim; ++i)
      for (int j = 0; j < dim; ++j) P.at(i, j) = start(i, j);
    Eigen::MatrixXd B = Eigen::MatrixXd::Identity(dim, dim), blocks = Eigen::MatrixXd::Zero(P.capacity(), 3);
    for (int i = 0; i < dim; i += i + 3 == single_at ? 3 + num_single : 3) {
      for (int r = 0; r < 3; ++r)
        for (int c = 0; c < 3; ++c) B(i + r, i + c) = blocks(i + r, c) = normal(rng);
    }
    P.turn(blocks.data(), single_at, num_single);
    const Eigen::MatrixXd should = B * start * B.transpose();
    EXPECT_LT((dense(P) - should).cwiseAbs().maxCoeff(), 1e-13 * should.norm()) << num_single;
    EXPECT_EQ((dense(P) - dense(P).transpose()).cwiseAbs().maxCoeff(), 0.0);
  }
}

TEST(StateCovariance, GrowsAndShrinksAnywhere) {
  auto rng = testing::make_rng();
  StateCovariance P;
  P.reserve(40, 8);
  ASSERT_TRUE(P.grow(30));
  const Eigen::MatrixXd all = random_covariance(rng, 30);
  for (int i = 0; i < 30; ++i)
    for (int j = 0; j < 30; ++j) P.at(i, j) = all(i, j);
  P.remove(12, 6);
  ASSERT_EQ(P.dim(), 24);
  for (int i = 0; i < 24; ++i)
    for (int j = 0; j < 24; ++j) EXPECT_EQ(P.at(i, j), all(i < 12 ? i : i + 6, j < 12 ? j : j + 6));
  ASSERT_TRUE(P.grow(16));
  for (int i = 24; i < 40; ++i)
    for (int j = 0; j < 40; ++j) EXPECT_EQ(P.at(i, j) + P.at(j, i), 0.0);  // nothing left of what stood there
  EXPECT_FALSE(P.grow(1));
}

}  // namespace
}  // namespace alidade
