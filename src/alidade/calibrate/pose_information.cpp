#include "alidade/calibrate/pose_information.h"

#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

std::vector<int> free_parameters(const Camera& camera) {
  std::vector<int> free;
  for (int i = 0; i < camera.cov.rows(); ++i) {
    if (camera.cov(i, i) > 0.0) free.push_back(i);
  }
  return free;
}

Eigen::MatrixXd submatrix(const Eigen::MatrixXd& full, const std::vector<int>& rows) {
  const auto n = static_cast<Eigen::Index>(rows.size());
  Eigen::MatrixXd part(n, n);
  for (Eigen::Index i = 0; i < n; ++i) {
    for (Eigen::Index j = 0; j < n; ++j) {
      part(i, j) = full(rows[static_cast<std::size_t>(i)], rows[static_cast<std::size_t>(j)]);
    }
  }
  return part;
}

Eigen::MatrixXd full_matrix(const Eigen::MatrixXd& part, const std::vector<int>& rows, Eigen::Index size) {
  Eigen::MatrixXd full = Eigen::MatrixXd::Zero(size, size);
  for (std::size_t i = 0; i < rows.size(); ++i) {
    for (std::size_t j = 0; j < rows.size(); ++j) {
      full(rows[i], rows[j]) = part(static_cast<Eigen::Index>(i), static_cast<Eigen::Index>(j));
    }
  }
  return full;
}

std::optional<BoardView> predicted_view(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                        const Rigid3& cam_from_board, double margin_px) {
  BoardView view;
  for (std::size_t i = 0; i < board_points.size(); ++i) {
    const auto px = project(camera, cam_from_board * board_points[i]);
    const bool is_inside = px && px->x() > margin_px && px->y() > margin_px &&
                           px->x() < camera.width_px - 1.0 - margin_px && px->y() < camera.height_px - 1.0 - margin_px;
    if (!is_inside) return std::nullopt;
    view.corners.push_back({static_cast<int>(i), *px});
  }
  return view;
}

std::optional<Eigen::MatrixXd> lens_information(const Camera& camera, const std::vector<Eigen::Vector3d>& board_points,
                                                const BoardView& view, const Rigid3& cam_from_board,
                                                const std::vector<int>& free) {
  const ViewArrays arrays = make_arrays(view);
  BundleProblem problem;
  problem.views = {&arrays, 1};
  problem.free_lens = free;
  problem.prior_value = params(camera.lens);
  problem.prior_information = Eigen::VectorXd::Zero(problem.prior_value.size());
  NormalEquations eq;
  if (!linearize(problem, {camera.lens, {cam_from_board}, board_points}, eq)) return std::nullopt;
  const Llt V(eq.V.front());
  if (!V.is_positive()) return std::nullopt;
  const Eigen::MatrixXd H = eq.H.selfadjointView<Eigen::Lower>();
  return Eigen::MatrixXd(H - eq.coupling(0) * V.solve_each(eq.coupling(0).transpose()));
}

}  // namespace alidade
