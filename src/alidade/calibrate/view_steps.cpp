#include "alidade/calibrate/view_steps.h"

#include <Eigen/Cholesky>
#include <cmath>

#include "alidade/calibrate/columns.h"
#include "alidade/calibrate/normal_equations.h"

namespace alidade {
namespace {

using Eigen::Index;
using ColumnsMap = Eigen::Map<const Eigen::MatrixXd>;

/// J X: the view's whitened Jacobian by all globals, times the columns X of their covariance.
void fill_product(const BundleProblem& problem, const ViewArrays& view, const Columns& columns,
                  const Eigen::MatrixXd& X, Eigen::MatrixXd& JX) {
  const auto rows = static_cast<Index>(columns.num_rows());
  JX.setZero(rows, X.cols());
  const auto column = [&](int c) { return Eigen::Map<const Eigen::VectorXd>(columns[c], rows); };
  Index at = 0;
  for (const int parameter : problem.free_lens) JX.noalias() += column(parameter) * X.row(at++);
  const auto half = static_cast<Index>(columns.stride());
  for (Index i = 0; i < static_cast<Index>(view.size()); ++i) {
    const Index point = at + 3 * view.index[static_cast<std::size_t>(i)];
    for (int c = 0; c < 3; ++c) {
      const double* by_point = columns[Columns::pose + c];
      JX.row(i) += by_point[i] * X.row(point + c);
      JX.row(half + i) += by_point[half + i] * X.row(point + c);
    }
  }
}

/// The free points take degrees of freedom from every view's residuals: by how much the views' scores are too small.
double score_scale(const BundleProblem& problem) {
  double rows = 0.0;
  for (const ViewArrays& view : problem.views) rows += 2.0 * static_cast<double>(view.size()) - 6.0;
  const double taken = 3.0 * static_cast<double>(problem.printed_points.size()) - 7.0;
  return std::sqrt(rows / std::max(rows - taken, 0.1 * rows));
}

/// From what the last linearisation kept of each view: lens and bow.
std::vector<ClusterStep> dense_steps(const NormalEquations& eq, const Eigen::MatrixXd& X) {
  const Index dense = eq.num_dense;
  std::vector<ClusterStep> steps;
  steps.reserve(eq.V.size());
  Eigen::MatrixXd reduced(dense, dense + 1);
  for (std::size_t k = 0; k < eq.V.size(); ++k) {
    const Eigen::LLT<Eigen::Matrix<double, 6, 6>> V(eq.V[k]);
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, 18> rows(6, dense + 1);
    rows.leftCols(dense) = eq.coupling(k).transpose();
    rows.col(dense) = eq.pose_gradient[k];
    V.matrixL().solveInPlace(rows);
    reduced.noalias() = eq.dense_of(k) - rows.leftCols(dense).transpose() * rows;  // the pose follows
    steps.push_back({X.transpose() * reduced.col(dense), X.transpose() * reduced.leftCols(dense) * X});
  }
  return steps;
}

/// With every point of the board free: each view moves its own points only, so its rows are multiplied out.
std::vector<ClusterStep> sparse_steps(const BundleProblem& problem, const BundleResult& result,
                                      const Eigen::MatrixXd& X) {
  const Index num_lens = X.cols();
  const PreparedLens lens = prepare(result.state.lens);
  const PointArrays points = make_arrays(result.state.board_points);
  const double scale = score_scale(problem);
  std::vector<ClusterStep> steps;
  steps.reserve(problem.views.size());
  Columns columns;
  Eigen::MatrixXd JX;
  for (std::size_t k = 0; k < problem.views.size(); ++k) {
    steps.push_back({Eigen::VectorXd::Zero(num_lens), Eigen::MatrixXd::Zero(num_lens, num_lens)});
    const ViewArrays& view = problem.views[k];
    if (!fill_columns(lens, result.state.cam_from_board[k], points, view, columns)) continue;
    fill_product(problem, view, columns, X, JX);
    const auto rows = static_cast<Index>(columns.num_rows());
    const ColumnsMap pose(columns[Columns::pose], rows, 6);
    const Eigen::Map<const Eigen::VectorXd> residual(columns[Columns::residual], rows);
    const Eigen::LLT<Eigen::Matrix<double, 6, 6>> V(Eigen::Matrix<double, 6, 6>(pose.transpose() * pose));
    if (V.info() != Eigen::Success) continue;
    const Eigen::Matrix<double, 6, Eigen::Dynamic> by_pose = V.solve(pose.transpose() * JX);
    JX.noalias() -= pose * by_pose;  // the pose follows
    steps.back().step = scale * (JX.transpose() * residual);
    steps.back().spread.noalias() = JX.transpose() * JX;
  }
  return steps;
}

}  // namespace

std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result) {
  const Eigen::MatrixXd X = result.cov.leftCols(static_cast<Index>(problem.free_lens.size()));
  return problem.shape == BoardShape::free ? sparse_steps(problem, result, X) : dense_steps(*result.equations, X);
}

}  // namespace alidade
