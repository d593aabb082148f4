#include "alidade/geometry/decompositions.h"

#include <Eigen/Eigenvalues>
#include <Eigen/LU>
#include <Eigen/QR>
#include <Eigen/SVD>
#include <cmath>
#include <limits>

namespace alidade {

SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> eigen(symmetric);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

SymmetricEigen3 symmetric_eigen3(const Eigen::Matrix3d& symmetric) {
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> eigen(symmetric);
  return {eigen.eigenvalues(), eigen.eigenvectors()};
}

Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& symmetric) {
  return Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd>(symmetric, Eigen::EigenvaluesOnly).eigenvalues();
}

Svd svd_of(const Eigen::MatrixXd& M) {
  const Eigen::JacobiSVD<Eigen::MatrixXd> svd(M, Eigen::ComputeThinU | Eigen::ComputeFullV);
  return {svd.matrixU(), svd.singularValues(), svd.matrixV()};
}

Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& M) {
  return Eigen::EigenSolver<Eigen::MatrixXd>(M, false).eigenvalues();
}

Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& A, Eigen::Index num) {
  return Eigen::HouseholderQR<Eigen::MatrixXd>(A).householderQ() * Eigen::MatrixXd::Identity(A.rows(), num);
}

Eigen::Matrix<double, 3, 2> two_across(const Eigen::Vector3d& unit) {
  const Eigen::Vector3d aside = std::abs(unit.x()) < 0.7 ? Eigen::Vector3d::UnitX() : Eigen::Vector3d::UnitY();
  Eigen::Matrix<double, 3, 2> B;
  B.col(0) = unit.cross(aside).normalized();
  B.col(1) = unit.cross(B.col(0));
  return B;
}

Eigen::VectorXd least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b) {
  return Eigen::ColPivHouseholderQR<Eigen::MatrixXd>(A).solve(b);
}

Eigen::MatrixXd minimum_norm_solution(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                      const Eigen::Ref<const Eigen::MatrixXd>& B) {
  return Eigen::CompleteOrthogonalDecomposition<Eigen::MatrixXd>(A).solve(B);
}

Ldlt::Ldlt(const Eigen::Ref<const Eigen::MatrixXd>& symmetric) : ldlt_(symmetric) {}
bool Ldlt::is_positive() const { return ldlt_.info() == Eigen::Success && ldlt_.isPositive(); }
Eigen::VectorXd Ldlt::pivots() const { return ldlt_.vectorD(); }
double Ldlt::min_pivot() const {
  const Eigen::VectorXd D = pivots();
  return ldlt_.info() == Eigen::Success && D.allFinite() ? D.minCoeff() : std::numeric_limits<double>::quiet_NaN();
}
Eigen::VectorXd Ldlt::solve(const Eigen::Ref<const Eigen::VectorXd>& b) const { return ldlt_.solve(b); }
Eigen::MatrixXd Ldlt::solve_each(const Eigen::Ref<const Eigen::MatrixXd>& B) const { return ldlt_.solve(B); }
Eigen::MatrixXd Ldlt::inverse() const { return ldlt_.solve(Eigen::MatrixXd::Identity(ldlt_.rows(), ldlt_.cols())); }

Eigen::VectorXd solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                const Eigen::Ref<const Eigen::VectorXd>& b) {
  return Ldlt(A).solve(b);
}

Eigen::MatrixXd inverse_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& A) { return Ldlt(A).inverse(); }

double squared_mahalanobis(const Eigen::Ref<const Eigen::VectorXd>& error,
                           const Eigen::Ref<const Eigen::MatrixXd>& cov) {
  return error.dot(Ldlt(cov).solve(error));
}

Llt::Llt(const Eigen::Ref<const Eigen::MatrixXd>& symmetric) : llt_(symmetric) {}
bool Llt::is_positive() const { return llt_.info() == Eigen::Success; }
Eigen::VectorXd Llt::solve(const Eigen::Ref<const Eigen::VectorXd>& b) const { return llt_.solve(b); }
Eigen::MatrixXd Llt::solve_each(const Eigen::Ref<const Eigen::MatrixXd>& B) const { return llt_.solve(B); }
Eigen::MatrixXd Llt::inverse() const { return llt_.solve(Eigen::MatrixXd::Identity(llt_.rows(), llt_.cols())); }
Eigen::MatrixXd Llt::lower() const { return llt_.matrixL(); }
Eigen::MatrixXd Llt::whitened(const Eigen::Ref<const Eigen::MatrixXd>& B) const { return llt_.matrixL().solve(B); }

Eigen::MatrixXd scaled_by(const Eigen::VectorXd& scale, const Eigen::MatrixXd& A) {
  return scale.asDiagonal() * A * scale.asDiagonal();
}

Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& M) {
  const Eigen::JacobiSVD<Eigen::Matrix3d> svd(M, Eigen::ComputeFullU | Eigen::ComputeFullV);
  const double mirror = svd.matrixU().determinant() * svd.matrixV().determinant() < 0.0 ? -1.0 : 1.0;
  return svd.matrixU() * Eigen::Vector3d(1.0, 1.0, mirror).asDiagonal() * svd.matrixV().transpose();
}

}  // namespace alidade
