#include "alidade/rig/checks/board_print.h"

#include "alidade/rig/checks/rig_score.h"

namespace alidade {
namespace {

using Eigen::Index;
using Eigen::MatrixXd;
using Eigen::VectorXd;

constexpr Index num_tested = 4;  // stretch, and z by x², xy, y²

/// Its middle, and half of its extent in x and y.
struct Extent {
  Eigen::Vector2d middle = Eigen::Vector2d::Zero(), half = Eigen::Vector2d::Zero();
};

Extent extent_of(std::span<const Eigen::Vector3d> points) {
  Eigen::Vector2d low = points.front().head<2>(), high = low;
  for (const Eigen::Vector3d& point : points) {
    low = low.cwiseMin(point.head<2>());
    high = high.cwiseMax(point.head<2>());
  }
  return {0.5 * (low + high), 0.5 * (high - low)};
}

/// ∂ point / ∂ what is tested: the stretch leaves the mean of both sides; bends are those of the board's ends.
Eigen::Matrix<double, 3, num_tested> by_print(const Extent& extent, const Eigen::Vector3d& point) {
  const Eigen::Vector2d from_middle = point.head<2>() - extent.middle;
  const double x = from_middle.x() / extent.half.x(), y = from_middle.y() / extent.half.y();
  Eigen::Matrix<double, 3, num_tested> J = Eigen::Matrix<double, 3, num_tested>::Zero();
  J(0, 0) = 0.5 * from_middle.x();
  J(1, 0) = -0.5 * from_middle.y();
  J.row(2).tail<3>() << x * x, x * y, y * y;
  return J;
}

MatrixXd print_columns(const RigProblem& problem, const Extent& extent, std::size_t v, const RigViewResiduals& at) {
  MatrixXd D = MatrixXd::Zero(at.r.size(), num_tested);
  const std::vector<Corner>& corners = problem.views[v].view->seen.corners;
  for (std::size_t i = 0; i < corners.size(); ++i) {
    const auto row = static_cast<Index>(2 * i);
    D.middleRows<2>(row) = at.J_board.block<2, 3>(row, 0) *
                           by_print(extent, problem.points_in_board[static_cast<std::size_t>(corners[i].index)]);
  }
  return D;
}

}  // namespace

std::vector<RigCause> board_print(const RigProblem& problem, const SolvedRig& solved, const MatrixXd& cov,
                                  std::span<const double> weights, const MatrixXd& cov_lenses, double num_given) {
  constexpr double min_effect = 1.0;  // in σ of a parameter
  std::vector<RigCause> causes;
  const Extent extent = extent_of(problem.points_in_board);
  if (!(extent.half.minCoeff() > 0.0)) return causes;
  const RigScore score =
      rig_score(problem, solved, cov, weights, num_tested, [&](std::size_t v) -> std::optional<TestedColumns> {
        const auto at = view_residuals(problem, solved.state, v);
        if (!at) return std::nullopt;
        return TestedColumns{0, print_columns(problem, extent, v, *at)};
      });
  const auto add = [&](const char* name, const char* unit, const std::vector<Index>& places, double worst) {
    const auto num = static_cast<Index>(places.size());
    const auto asked = score.asked(places, worst, VectorXd::Zero(num), cov_lenses, num_given);
    if (!asked) return;
    const double effect = asked->moves.cwiseAbs().cwiseQuotient(cov.diagonal().cwiseSqrt()).maxCoeff();
    const double size = num == 1 ? asked->size[0] : asked->size.norm();
    if (effect > min_effect) causes.push_back({name, size, unit, asked->sigmas});
  };
  add(board_stretch_name, "", {0}, 0.05);
  add(board_bend_name, "m", {1, 2, 3}, 0.05);
  return causes;
}

}  // namespace alidade
