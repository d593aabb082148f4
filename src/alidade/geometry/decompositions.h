#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>

// Eigen's decompositions cost seconds to compile for each size and file: where microseconds do not count, these are
// theirs for any size, compiled once.

namespace alidade {

/// Of a symmetric matrix (its lower triangle is read): eigenvalues, ascending, and their vectors as columns.
struct SymmetricEigen {
  Eigen::VectorXd values;
  Eigen::MatrixXd vectors;
};
[[nodiscard]] SymmetricEigen symmetric_eigen(const Eigen::MatrixXd& symmetric);
struct SymmetricEigen3 {
  Eigen::Vector3d values;
  Eigen::Matrix3d vectors;
};
[[nodiscard]] SymmetricEigen3 symmetric_eigen3(const Eigen::Matrix3d& symmetric);
[[nodiscard]] Eigen::VectorXd symmetric_eigenvalues(const Eigen::MatrixXd& symmetric);

/// M = U diag(values) Vᵀ, values descending; V square, U with as many columns as there are values.
struct Svd {
  Eigen::MatrixXd U;
  Eigen::VectorXd values;
  Eigen::MatrixXd V;
};
[[nodiscard]] Svd svd_of(const Eigen::MatrixXd& M);

/// Eigenvalues of a square matrix, in no order.
[[nodiscard]] Eigen::VectorXcd eigenvalues_of(const Eigen::MatrixXd& M);

/// The first `num` of orthonormal columns, of which the first span those of A, the rest what is across them.
[[nodiscard]] Eigen::MatrixXd orthonormal_basis(const Eigen::MatrixXd& A, Eigen::Index num);

/// Two directions at right angles to a unit vector and to each other, as columns.
[[nodiscard]] Eigen::Matrix<double, 3, 2> two_across(const Eigen::Vector3d& unit);

/// x of the least |A x − b|, by column-pivoting QR.
[[nodiscard]] Eigen::VectorXd least_squares(const Eigen::MatrixXd& A, const Eigen::VectorXd& b);

/// The same for any rank, each column of B for itself: of the x that reach it, the shortest.
[[nodiscard]] Eigen::MatrixXd minimum_norm_solution(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                                    const Eigen::Ref<const Eigen::MatrixXd>& B);

/// L D Lᵀ of a symmetric matrix, n × n; its lower triangle is read. Of a singular one, or one that is not finite,
/// min_pivot() says so, and solutions are of no use.
class Ldlt {
 public:
  Ldlt() = default;  ///< Of nothing yet.
  explicit Ldlt(const Eigen::Ref<const Eigen::MatrixXd>& symmetric);
  [[nodiscard]] bool is_positive() const;
  [[nodiscard]] Eigen::VectorXd pivots() const;  ///< D.
  [[nodiscard]] double min_pivot() const;        ///< Of D; NaN where the matrix has no such decomposition.
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd>& b) const;
  [[nodiscard]] Eigen::MatrixXd solve_each(const Eigen::Ref<const Eigen::MatrixXd>& B) const;  ///< Column by column.
  [[nodiscard]] Eigen::MatrixXd inverse() const;

 private:
  Eigen::LDLT<Eigen::MatrixXd> ldlt_;
};
/// A⁻¹ b and A⁻¹ of a symmetric matrix, by Ldlt.
[[nodiscard]] Eigen::VectorXd solve_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& A,
                                              const Eigen::Ref<const Eigen::VectorXd>& b);
[[nodiscard]] Eigen::MatrixXd inverse_symmetric(const Eigen::Ref<const Eigen::MatrixXd>& A);
/// eᵀ Σ⁻¹ e: χ² with as many degrees of freedom as e has components, where Σ is its covariance.
[[nodiscard]] double squared_mahalanobis(const Eigen::Ref<const Eigen::VectorXd>& error,
                                         const Eigen::Ref<const Eigen::MatrixXd>& cov);

/// L Lᵀ of a symmetric positive definite matrix, n × n; its lower triangle is read. Where it is none, is_positive()
/// says so, and the rest is of no use.
class Llt {
 public:
  explicit Llt(const Eigen::Ref<const Eigen::MatrixXd>& symmetric);
  [[nodiscard]] bool is_positive() const;
  [[nodiscard]] Eigen::VectorXd solve(const Eigen::Ref<const Eigen::VectorXd>& b) const;
  [[nodiscard]] Eigen::MatrixXd solve_each(const Eigen::Ref<const Eigen::MatrixXd>& B) const;  ///< Column by column.
  [[nodiscard]] Eigen::MatrixXd inverse() const;
  [[nodiscard]] Eigen::MatrixXd lower() const;                                               ///< L.
  [[nodiscard]] Eigen::MatrixXd whitened(const Eigen::Ref<const Eigen::MatrixXd>& B) const;  ///< L⁻¹ B.

 private:
  Eigen::LLT<Eigen::MatrixXd> llt_;
};

/// diag(scale) A diag(scale).
[[nodiscard]] Eigen::MatrixXd scaled_by(const Eigen::VectorXd& scale, const Eigen::MatrixXd& A);

/// The rotation nearest to a matrix (Frobenius): U diag(1, 1, det UVᵀ) Vᵀ. W. Kabsch, Acta Cryst. A32, 1976.
[[nodiscard]] Eigen::Matrix3d nearest_rotation(const Eigen::Matrix3d& M);

}  // namespace alidade
