#pragma once

#include <Eigen/Cholesky>
#include <Eigen/Core>
#include <vector>

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/columns.h"

namespace alidade {

/// Normal equations of a bundle at one state. Globals are the free lens parameters, then the shape; each view has a
/// 6 × 6 pose block V, its coupling W (globals × 6) and its gradient. Right-hand sides are gradients Jᵀr.
struct NormalEquations {
  int num_globals = 0;
  double cost = 0.0;
  Eigen::MatrixXd H;  ///< globals × globals, lower triangle.
  Eigen::VectorXd gradient;
  std::vector<double> W;                       ///< View by view, globals × 6 column-major.
  std::vector<Eigen::Matrix<double, 6, 6>> V;  ///< Lower triangle.
  std::vector<Eigen::Matrix<double, 6, 1>> pose_gradient;
  /// Contribution of each view to the dense globals (lens and bow): H and gradient, dense × (dense + 1).
  int num_dense = 0;
  std::vector<double> view_dense;

  [[nodiscard]] Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, 6>> coupling(std::size_t view) const {
    return {W.data() + view * 6 * static_cast<std::size_t>(num_globals), num_globals, 6};
  }
  [[nodiscard]] Eigen::Map<const Eigen::MatrixXd> dense_of(std::size_t view) const {
    const auto size = static_cast<std::size_t>(num_dense * (num_dense + 1));
    return {view_dense.data() + view * size, num_dense, num_dense + 1};
  }
};

/// Cholesky factor L of a view's pose block. Eigen packs blocks before it solves for several columns, which takes
/// longer than the solve of these six rows itself.
class PoseFactor {
 public:
  explicit PoseFactor(const Eigen::Matrix<double, 6, 6>& V) : llt_(V) {
    inverse_diagonal_ = llt_.matrixLLT().diagonal().cwiseInverse();
  }
  [[nodiscard]] bool ok() const { return llt_.info() == Eigen::Success; }

  /// rows = L⁻¹ rows
  template <class Rows>
  void solve_lower(Rows&& rows) const {
    const Eigen::Matrix<double, 6, 6>& L = llt_.matrixLLT();
    for (Eigen::Index c = 0; c < rows.cols(); ++c) {
      Eigen::Matrix<double, 6, 1> x = rows.col(c);
      for (int j = 0; j < 6; ++j) {
        x[j] *= inverse_diagonal_[j];
        for (int i = j + 1; i < 6; ++i) x[i] -= L(i, j) * x[j];
      }
      rows.col(c) = x;
    }
  }

  /// rows = V⁻¹ rows
  template <class Rows>
  void solve(Rows&& rows) const {
    solve_lower(rows);
    const Eigen::Matrix<double, 6, 6>& L = llt_.matrixLLT();
    for (Eigen::Index c = 0; c < rows.cols(); ++c) {
      Eigen::Matrix<double, 6, 1> x = rows.col(c);
      for (int i = 5; i >= 0; --i) {
        for (int j = i + 1; j < 6; ++j) x[i] -= L(j, i) * x[j];
        x[i] *= inverse_diagonal_[i];
      }
      rows.col(c) = x;
    }
  }

 private:
  Eigen::LLT<Eigen::Matrix<double, 6, 6>> llt_;
  Eigen::Matrix<double, 6, 1> inverse_diagonal_;
};

/// Heights of the bow's two parabolas at every point, 1 in the centre and 0 at the border, from the printed board.
struct BowBasis {
  std::vector<double> along_x, along_y;
};
[[nodiscard]] BowBasis bow_basis(const std::vector<Eigen::Vector3d>& printed_points);

/// The seven directions (orthonormal rows, 7 × 3n) in which a point set moves rigidly or scales: the gauge freedom.
[[nodiscard]] Eigen::MatrixXd gauge_directions(const std::vector<Eigen::Vector3d>& points);

/// Number of global unknowns of a problem.
[[nodiscard]] int num_globals(const BundleProblem& problem);

/// Fills `equations` at `state`. False if a corner cannot be projected: this state must be rejected.
[[nodiscard]] bool linearize(const BundleProblem& problem, const BundleState& state, NormalEquations& equations);

}  // namespace alidade
