#include "alidade/calibrate/solve/view_steps.h"

#include <algorithm>
#include <cmath>

#include "alidade/calibrate/solve/columns.h"
#include "alidade/calibrate/solve/normal_equations.h"

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

/// Does a view's fit to the board's shape count? Each view has about 1/n of the information about the shape: of fifty,
/// it changes σ by a hundredth.
bool shape_counts(const BundleProblem& problem) {
  constexpr std::size_t many_views = 50;
  return problem.views.size() < many_views;
}

/// From what the last linearisation kept of each view: lens and bow.
std::vector<ClusterStep> dense_steps(const BundleProblem& problem, const BundleResult& result,
                                     const Eigen::MatrixXd& X) {
  constexpr int most = Columns::max_lens + 2;  // dense globals and the gradient
  const NormalEquations& eq = *result.equations;
  const Index dense = eq.num_dense, both = dense + 1, num_lens = X.cols(), num = std::ssize(eq.V);
  Eigen::MatrixXd reduced(dense, both * num);
  for (Index k = 0; k < num; ++k) {
    const auto view = static_cast<std::size_t>(k);
    Eigen::Matrix<double, 6, Eigen::Dynamic, 0, 6, most> rows(6, both);
    rows.leftCols(dense) = eq.coupling(view).transpose();
    rows.col(dense) = eq.pose_gradient[view];
    (*result.pose_factors)[view].solve_lower(rows);
    auto own = reduced.middleCols(k * both, both);
    own = eq.dense_of(view);
    own.noalias() -= rows.leftCols(dense).transpose().lazyProduct(rows);  // the pose follows
  }
  // All views at once: many products of small matrices take longer than one of a large one.
  const Eigen::MatrixXd pulls = X.transpose() * reduced;
  Eigen::MatrixXd turned(dense, num_lens * num);
  for (Index k = 0; k < num; ++k)
    turned.middleCols(k * num_lens, num_lens) = pulls.middleCols(k * both, dense).transpose();
  const Eigen::MatrixXd spreads = X.transpose() * turned;
  const bool takes = num_lens < dense && shape_counts(problem);
  std::vector<ClusterStep> steps;
  steps.reserve(eq.V.size());
  for (Index k = 0; k < num; ++k) {
    steps.push_back({pulls.col(k * both + dense), spreads.middleCols(k * num_lens, num_lens), {}});
    const auto pull = pulls.middleCols(k * both, dense);
    if (takes) steps.back().taken = pull * result.cov * pull.transpose();
  }
  return steps;
}

/// (J X)ᵀ J: the product with the view's columns themselves. J X has its pose taken out.
void fill_pull(const BundleProblem& problem, const ViewArrays& view, const Columns& columns, const Eigen::MatrixXd& JX,
               Eigen::MatrixXd& pull) {
  const auto rows = static_cast<Index>(columns.num_rows());
  pull.setZero();
  Index at = 0;
  for (const int parameter : problem.free_lens) {
    pull.col(at++).noalias() = JX.transpose() * Eigen::Map<const Eigen::VectorXd>(columns[parameter], rows);
  }
  const auto half = static_cast<Index>(columns.stride());
  for (Index i = 0; i < static_cast<Index>(view.size()); ++i) {
    const Index point = at + 3 * view.index[static_cast<std::size_t>(i)];
    for (int c = 0; c < 3; ++c) {
      const double* by_point = columns[Columns::pose + c];
      pull.col(point + c) += by_point[i] * JX.row(i).transpose() + by_point[half + i] * JX.row(half + i).transpose();
    }
  }
}

/// With every point of the board free: each view moves its own points only, so its rows are multiplied out.
std::vector<ClusterStep> sparse_steps(const BundleProblem& problem, const BundleResult& result,
                                      const Eigen::MatrixXd& X) {
  const Index num_lens = X.cols();
  const PreparedLens lens = prepare(result.state.lens);
  const PointArrays points = make_arrays(result.state.board_points);
  const bool takes = shape_counts(problem);
  std::vector<ClusterStep> steps;
  steps.reserve(problem.views.size());
  Columns columns;
  Eigen::MatrixXd JX, pull(num_lens, X.rows()), pulled(num_lens, X.rows());
  for (std::size_t k = 0; k < problem.views.size(); ++k) {
    const Eigen::MatrixXd none = Eigen::MatrixXd::Zero(num_lens, num_lens);
    steps.push_back({Eigen::VectorXd::Zero(num_lens), none, {}});
    if (takes) steps.back().taken = none;
    const ViewArrays& view = problem.views[k];
    if (!fill_columns(lens, result.state.cam_from_board[k], points, view, columns)) continue;
    fill_product(problem, view, columns, X, JX);
    const auto rows = static_cast<Index>(columns.num_rows());
    const ColumnsMap pose(columns[Columns::pose], rows, 6);
    const Eigen::Map<const Eigen::VectorXd> residual(columns[Columns::residual], rows);
    const PoseFactor V(pose.transpose() * pose);
    if (!V.ok()) continue;
    Eigen::Matrix<double, 6, Eigen::Dynamic> by_pose = pose.transpose() * JX;
    V.solve(by_pose);
    JX.noalias() -= pose * by_pose;  // the pose follows
    steps.back().step = JX.transpose() * residual;
    steps.back().spread.noalias() = JX.transpose() * JX;
    if (!takes) continue;
    fill_pull(problem, view, columns, JX, pull);
    pulled.noalias() = pull * result.cov;
    steps.back().taken.noalias() = pulled * pull.transpose();
  }
  return steps;
}

/// H⁻¹ (L⁻ᵀ; 0): by its transpose information and gradient of all globals are those of L⁻¹ times the lens.
Eigen::MatrixXd to_whitened(const BundleResult& result, const Eigen::MatrixXd& L) {
  Eigen::MatrixXd X = result.cov.leftCols(L.rows());
  L.triangularView<Eigen::Lower>().transpose().solveInPlace<Eigen::OnTheRight>(X);
  return X;
}

/// Jᵀr of each corner of a view by lens and bow, and by the pose: a row a corner.
void fill_pulls(const BundleProblem& problem, const Columns& columns, Index corners, Eigen::MatrixXd& by_lens,
                Eigen::Matrix<double, Eigen::Dynamic, 6>& by_pose) {
  const auto half = static_cast<Index>(columns.stride());
  const auto part = [&](int c, Index from) { return Eigen::Map<const Eigen::ArrayXd>(columns[c] + from, corners); };
  const auto pull = [&](int c) {
    return part(c, 0) * part(Columns::residual, 0) + part(c, half) * part(Columns::residual, half);
  };
  Index at = 0;
  for (const int parameter : problem.free_lens) by_lens.col(at++).head(corners) = pull(parameter);
  for (int c = 0; at < by_lens.cols(); ++c) by_lens.col(at++).head(corners) = pull(Columns::bow + c);
  for (int c = 0; c < 6; ++c) by_pose.col(c).head(corners) = pull(Columns::pose + c);
}

/// Adds pullsᵀ pulls, the lower triangle: of a few columns, dot products are done before a product has packed them.
template <class Pulls>
void add_scatter(const Pulls& pulls, Eigen::MatrixXd& scatter) {
  for (Index c = 0; c < pulls.cols(); ++c) {
    for (Index d = 0; d <= c; ++d) scatter(c, d) += pulls.col(c).dot(pulls.col(d));
  }
}

}  // namespace

std::vector<ClusterStep> view_steps(const BundleProblem& problem, const BundleResult& result,
                                    const Eigen::MatrixXd& L) {
  const Eigen::MatrixXd X = to_whitened(result, L);
  return problem.shape == BoardShape::free ? sparse_steps(problem, result, X) : dense_steps(problem, result, X);
}

CornerSteps corner_steps(const BundleProblem& problem, const BundleResult& result, const Eigen::MatrixXd& L) {
  CornerSteps found{{}, Eigen::MatrixXd::Zero(L.rows(), L.rows())};
  if (problem.shape == BoardShape::free) return found;
  constexpr std::size_t enough = 16, of_many = 4;  // by fewer, chance would be raised with the scale below
  const std::size_t num_views = problem.views.size(),
                    count = std::min(num_views, std::max(enough, num_views / of_many));
  const Eigen::MatrixXd X = to_whitened(result, L);
  const PreparedLens lens = prepare(result.state.lens);
  const PointArrays points = make_arrays(result.state.board_points);
  const auto num_points = static_cast<Index>(result.state.board_points.size());
  const bool bows = problem.shape == BoardShape::bow;
  const BowBasis basis = bows ? bow_basis(problem.printed_points) : BowBasis{};
  Columns columns;
  Eigen::MatrixXd scores = Eigen::MatrixXd::Zero(num_points, X.rows()), by_lens(num_points, X.rows());
  Eigen::MatrixXd scatter = Eigen::MatrixXd::Zero(X.rows(), X.rows());
  Eigen::Matrix<double, Eigen::Dynamic, 6> by_pose(num_points, 6);
  Eigen::Matrix<double, 6, Eigen::Dynamic> follows;
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t k = i * num_views / count;
    const ViewArrays& view = problem.views[k];
    if (!fill_columns(lens, result.state.cam_from_board[k], points, view, columns)) continue;
    if (bows) fill_bow_columns(view, basis.along_x, basis.along_y, columns);
    const auto corners = static_cast<Index>(view.size());
    fill_pulls(problem, columns, corners, by_lens, by_pose);
    follows = result.equations->coupling(k).transpose();
    (*result.pose_factors)[k].solve(follows);  // the pose does
    auto pulls = by_lens.topRows(corners);
    pulls.noalias() -= by_pose.topRows(corners).lazyProduct(follows);
    add_scatter(pulls, scatter);
    for (Index j = 0; j < scores.cols(); ++j)
      for (Index c = 0; c < corners; ++c) scores(view.index[static_cast<std::size_t>(c)], j) += pulls(c, j);
  }
  // Of an estimate from these views alone: what they share moves it as it moves that of all.
  const double scale = std::sqrt(static_cast<double>(num_views) / static_cast<double>(std::max<std::size_t>(1, count)));
  const Eigen::MatrixXd steps = scale * scores * X;
  for (Index point = 0; point < num_points; ++point) {
    if (steps.row(point).squaredNorm() > 0.0) found.steps.push_back({steps.row(point).transpose(), {}, {}});
  }
  found.by_themselves = scale * scale * (X.transpose() * scatter.selfadjointView<Eigen::Lower>() * X);
  return found;
}

}  // namespace alidade
