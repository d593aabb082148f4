#include "alidade/calibrate/solve/normal_equations.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <limits>

#include "alidade/board/board_bend.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Pose6 = Eigen::Matrix<double, 6, 6>;

/// Scratch of one linearisation: the columns of the view at hand and their products.
struct Scratch {
  Columns columns;
  std::vector<const double*> pointers;
  std::vector<double> product;
};

/// Adds one view by its Gram matrix: dense globals, pose and residual.
void add_dense_view(const Scratch& s, int num_dense, std::size_t k, NormalEquations& eq) {
  const int m = static_cast<int>(s.pointers.size());
  const Eigen::Map<const Eigen::Matrix<double, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>> G(s.product.data(), m,
                                                                                                   m);
  const int residual = num_dense + 6;
  double* of_view = eq.view_dense.data() + k * static_cast<std::size_t>(num_dense * (num_dense + 1));
  for (int j = 0; j < num_dense; ++j) {
    for (int i = 0; i <= j; ++i) {
      eq.H(j, i) += G(i, j);
      of_view[j * num_dense + i] = of_view[i * num_dense + j] = G(i, j);
    }
    eq.gradient[j] += G(j, residual);
    of_view[num_dense * num_dense + j] = G(j, residual);
  }
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> W(eq.W.data() + k * 6 * static_cast<std::size_t>(eq.num_globals),
                                                         eq.num_globals, 6);
  W.topRows(num_dense) = G.block(0, num_dense, num_dense, 6);
  for (int j = 0; j < 6; ++j) {
    for (int i = j; i < 6; ++i) eq.V[k](i, j) = G(num_dense + j, num_dense + i);
    eq.pose_gradient[k][j] = G(num_dense + j, residual);
  }
  eq.cost += G(residual, residual);
}

/// Adds what the free board points share with lens, pose and residual. Sparse: each corner moves its own point only.
void add_point_blocks(const Scratch& s, const ViewArrays& view, int num_dense, std::size_t k, NormalEquations& eq) {
  Eigen::Map<Eigen::Matrix<double, Eigen::Dynamic, 6>> W(eq.W.data() + k * 6 * static_cast<std::size_t>(eq.num_globals),
                                                         eq.num_globals, 6);
  const std::size_t half = s.columns.stride();
  for (std::size_t i = 0; i < view.size(); ++i) {
    Eigen::Matrix<double, 2, 3> by_point;
    for (int c = 0; c < 3; ++c) {
      by_point(0, c) = s.columns[Columns::pose + c][i];
      by_point(1, c) = s.columns[Columns::pose + c][half + i];
    }
    const int at = num_dense + 3 * view.index[i];
    const auto row = [&](int column) {
      const double* values = s.pointers[static_cast<std::size_t>(column)];
      return Eigen::Vector2d(values[i], values[half + i]);
    };
    eq.H.block<3, 3>(at, at) += by_point.transpose() * by_point;
    for (int c = 0; c < num_dense; ++c) eq.H.block<3, 1>(at, c) += by_point.transpose() * row(c);
    for (int c = 0; c < 6; ++c) W.block<3, 1>(at, c) += by_point.transpose() * row(num_dense + c);
    eq.gradient.segment<3>(at) += by_point.transpose() * row(num_dense + 6);
  }
}

void add_lens_prior(const BundleProblem& problem, const BundleState& state, NormalEquations& eq) {
  const Eigen::VectorXd values = params(state.lens);
  for (std::size_t i = 0; i < problem.free_lens.size(); ++i) {
    const int at = problem.free_lens[i], j = static_cast<int>(i);
    const double information = problem.prior_information[at], off = values[at] - problem.prior_value[at];
    eq.H(j, j) += information;
    eq.gradient[j] += information * off;
    eq.cost += information * off * off;
  }
}

/// The weak prior of each point, and the gauge: rigid motion and scale of the points against the printed ones are zero.
void add_shape_prior(const BundleProblem& problem, const BundleState& state, NormalEquations& eq) {
  const int n3 = 3 * static_cast<int>(state.board_points.size());
  Eigen::VectorXd moved(n3);
  for (std::size_t i = 0; i < state.board_points.size(); ++i) {
    moved.segment<3>(3 * static_cast<Eigen::Index>(i)) = state.board_points[i] - problem.printed_points[i];
  }
  const double information = 1.0 / (problem.shape_sigma_m * problem.shape_sigma_m);
  const Eigen::MatrixXd gauge = gauge_directions(problem.printed_points);
  const double stiffness = eq.H.diagonal().tail(n3).mean() + information;  // of the data's own size
  const Eigen::VectorXd along = gauge * moved;
  eq.H.bottomRightCorner(n3, n3).triangularView<Eigen::Lower>() += stiffness * gauge.transpose() * gauge;
  eq.H.diagonal().tail(n3).array() += information;
  eq.gradient.tail(n3) += stiffness * gauge.transpose() * along + information * moved;
  eq.cost += information * moved.squaredNorm() + stiffness * along.squaredNorm();
}

}  // namespace

BowBasis bow_basis(const std::vector<Eigen::Vector3d>& printed_points) {
  const BoardBend bend(printed_points);
  BowBasis basis;
  for (const auto& point : printed_points) {
    const Eigen::Vector3d heights = bend.heights_at(point);
    basis.along_x.push_back(heights.x());
    basis.along_y.push_back(heights.y());
  }
  return basis;
}

Eigen::MatrixXd gauge_directions(const std::vector<Eigen::Vector3d>& points) {
  const auto n = static_cast<Eigen::Index>(points.size());
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const auto& point : points) centre += point / static_cast<double>(n);
  Eigen::MatrixXd directions(3 * n, 7);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Vector3d arm = points[static_cast<std::size_t>(i)] - centre;
    directions.block<3, 3>(3 * i, 0) = Eigen::Matrix3d::Identity();
    directions.block<3, 3>(3 * i, 3) = cross_matrix(arm);
    directions.block<3, 1>(3 * i, 6) = arm;
  }
  return orthonormal_basis(directions, 7).transpose();
}

int num_globals(const BundleProblem& problem) {
  const int lens = static_cast<int>(problem.free_lens.size());
  if (problem.shape == BoardShape::bow) return lens + 2;
  if (problem.shape == BoardShape::free) return lens + 3 * static_cast<int>(problem.printed_points.size());
  return lens;
}

bool linearize(const BundleProblem& problem, const BundleState& state, NormalEquations& eq) {
  const std::size_t num_views = problem.views.size();
  const int lens_count = static_cast<int>(problem.free_lens.size());
  const bool bow = problem.shape == BoardShape::bow, free = problem.shape == BoardShape::free;
  const int num_dense = lens_count + (bow ? 2 : 0);
  eq.num_globals = num_globals(problem);
  eq.num_dense = num_dense;
  eq.view_dense.resize(num_views * static_cast<std::size_t>(num_dense * (num_dense + 1)));
  eq.cost = 0.0;
  eq.H.setZero(eq.num_globals, eq.num_globals);
  eq.gradient.setZero(eq.num_globals);
  eq.W.assign(num_views * 6 * static_cast<std::size_t>(eq.num_globals), 0.0);
  eq.V.resize(num_views);
  eq.pose_gradient.resize(num_views);

  PreparedLens lens = prepare(state.lens);
  if (problem.passes_fold) lens.max_radius2 = std::numeric_limits<double>::infinity();
  const PointArrays points = make_arrays(state.board_points);
  const BowBasis basis = bow ? bow_basis(problem.printed_points) : BowBasis{};
  thread_local Scratch s;  // one per thread: kept between calls, so that the inner loop allocates nothing
  for (std::size_t k = 0; k < num_views; ++k) {
    const ViewArrays& view = problem.views[k];
    if (!fill_columns(lens, state.cam_from_board[k], points, view, s.columns)) return false;
    if (bow) fill_bow_columns(view, basis.along_x, basis.along_y, s.columns);
    s.pointers.clear();
    for (const int column : problem.free_lens) s.pointers.push_back(s.columns[column]);
    for (int i = 0; bow && i < 2; ++i) s.pointers.push_back(s.columns[Columns::bow + i]);
    for (int i = 0; i <= 6; ++i) s.pointers.push_back(s.columns[Columns::pose + i]);  // 6 of the pose, the residual
    while (s.pointers.size() % 4 != 0) s.pointers.push_back(s.columns[Columns::zero]);
    s.product.resize(s.pointers.size() * s.pointers.size());
    gram(s.pointers.data(), static_cast<int>(s.pointers.size()), s.columns.num_rows(), s.product.data());
    add_dense_view(s, num_dense, k, eq);
    if (free) add_point_blocks(s, view, num_dense, k, eq);
  }
  add_lens_prior(problem, state, eq);
  if (free) add_shape_prior(problem, state, eq);
  return std::isfinite(eq.cost);
}

}  // namespace alidade
