#include "alidade/geometry/decompositions.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <algorithm>
#include <complex>
#include <limits>

#include "alidade/geometry/so3.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

Eigen::MatrixXd drawn(std::mt19937_64& rng, Eigen::Index rows, Eigen::Index cols) {
  std::normal_distribution<double> normal;
  return Eigen::MatrixXd::NullaryExpr(rows, cols, [&] { return normal(rng); });
}

TEST(Decompositions, AreWhatTheySay) {
  auto rng = testing::make_rng();
  const Eigen::MatrixXd A = drawn(rng, 9, 4), S = A.transpose() * A;
  const SymmetricEigen eigen = symmetric_eigen(S);
  EXPECT_LT((S * eigen.vectors - eigen.vectors * eigen.values.asDiagonal()).norm(), 1e-12);
  EXPECT_TRUE(std::is_sorted(eigen.values.begin(), eigen.values.end()));
  EXPECT_LT((symmetric_eigenvalues(S) - eigen.values).norm(), 1e-12);
  const Eigen::Matrix3d S3 = S.topLeftCorner<3, 3>();
  EXPECT_LT(
      (S3 * symmetric_eigen3(S3).vectors.col(0) - symmetric_eigen3(S3).values[0] * symmetric_eigen3(S3).vectors.col(0))
          .norm(),
      1e-12);
  for (const Eigen::MatrixXd& M : {A, Eigen::MatrixXd(A.transpose())}) {
    const Svd svd = svd_of(M);
    EXPECT_EQ(svd.V.rows(), svd.V.cols());
    EXPECT_LT((svd.U * svd.values.asDiagonal() * svd.V.leftCols(svd.values.size()).transpose() - M).norm(), 1e-12);
    EXPECT_LT((svd.V.transpose() * svd.V - Eigen::MatrixXd::Identity(svd.V.rows(), svd.V.rows())).norm(), 1e-12);
  }
  const Eigen::MatrixXd Q = orthonormal_basis(A, 9);
  EXPECT_LT((Q.transpose() * Q - Eigen::MatrixXd::Identity(9, 9)).norm(), 1e-12);
  EXPECT_LT((Q.rightCols(5).transpose() * A).norm(), 1e-12);
  const Eigen::VectorXd b = drawn(rng, 9, 1), x = least_squares(A, b);
  EXPECT_LT((A.transpose() * (A * x - b)).norm(), 1e-12);
}

TEST(Decompositions, SolveWhatTheySay) {
  auto rng = testing::make_rng();
  const Eigen::MatrixXd A = drawn(rng, 9, 4), S = A.transpose() * A, B = drawn(rng, 4, 3);
  const Eigen::VectorXd b = B.col(0);
  const Ldlt ldlt(S);
  EXPECT_TRUE(ldlt.is_positive());
  EXPECT_LT((S * ldlt.solve(b) - b).norm(), 1e-12);
  EXPECT_LT((S * ldlt.solve_each(B) - B).norm(), 1e-12);
  EXPECT_LT((S * ldlt.inverse() - Eigen::MatrixXd::Identity(4, 4)).norm(), 1e-12);
  EXPECT_GT(ldlt.min_pivot(), 0.0);
  EXPECT_LE(ldlt.min_pivot(), S.diagonal().minCoeff());
  EXPECT_NEAR(Ldlt(Eigen::Vector3d(3.0, 0.5, 2.0).asDiagonal().toDenseMatrix()).min_pivot(), 0.5, 1e-15);
  Eigen::MatrixXd broken = S;
  broken(1, 0) = std::numeric_limits<double>::quiet_NaN();
  EXPECT_FALSE(Ldlt(broken).min_pivot() > 0.0);
  EXPECT_FALSE(Ldlt(Eigen::MatrixXd(A * A.transpose())).min_pivot() > 1e-12);  // rank 4 of 9
  EXPECT_LT((S * solve_symmetric(S, b) - b).norm(), 1e-12);
  EXPECT_LT((S * inverse_symmetric(S) - Eigen::MatrixXd::Identity(4, 4)).norm(), 1e-12);
  EXPECT_NEAR(squared_mahalanobis(S * b, S), b.dot(S * b), 1e-10 * b.dot(S * b));
  EXPECT_FALSE(Ldlt(-S).is_positive());
  Eigen::MatrixXd upper_is_wrong = S;
  upper_is_wrong(0, 3) = 1e3;
  EXPECT_EQ((Ldlt(upper_is_wrong).inverse() - ldlt.inverse()).norm(), 0.0);
  // Of the solutions of A Aᵀ x = A y the shortest has no part across the columns of A.
  const Eigen::MatrixXd singular = A * A.transpose(), right = A * drawn(rng, 4, 2);
  const Eigen::MatrixXd x = minimum_norm_solution(singular, right);
  EXPECT_LT((singular * x - right).norm(), 1e-10);
  EXPECT_LT((orthonormal_basis(A, 9).rightCols(5).transpose() * x).norm(), 1e-12);
}

/// (λ − 2)(λ² + 1) = λ³ − 2λ² + λ − 2.
TEST(Decompositions, EigenvaluesAreThePolynomialsRoots) {
  Eigen::Matrix3d companion;
  companion << 0, 0, 2, 1, 0, -1, 0, 1, 2;
  Eigen::VectorXcd roots = eigenvalues_of(companion);
  std::sort(roots.begin(), roots.end(), [](auto a, auto b) { return a.imag() < b.imag(); });
  EXPECT_LT(std::abs(roots[0] - std::complex<double>(0, -1)), 1e-12);
  EXPECT_LT(std::abs(roots[1] - 2.0), 1e-12);
  EXPECT_LT(std::abs(roots[2] - std::complex<double>(0, 1)), 1e-12);
}

TEST(Decompositions, NearestRotationOfATurnedStretchIsTheTurn) {
  const Eigen::Matrix3d R = exp_so3({0.4, -1.1, 0.3}).toRotationMatrix();
  EXPECT_LT((nearest_rotation(R * Eigen::Vector3d(3, 2, 0.5).asDiagonal()) - R).norm(), 1e-12);
  EXPECT_NEAR(nearest_rotation(-R).determinant(), 1.0, 1e-12);  // a mirror image has no rotation of its own
}

}  // namespace
}  // namespace alidade
