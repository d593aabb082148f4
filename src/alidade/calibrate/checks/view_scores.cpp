#include "alidade/calibrate/checks/view_scores.h"

#include "alidade/calibrate/setup.h"
#include "alidade/calibrate/solve/bundle.h"
#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/calibrate/study.h"
#include "alidade/geometry/decompositions.h"

namespace alidade {

std::vector<ViewScore> view_scores(const Board& board, CalibrateConfig config, std::span<const BoardView> views,
                                   const CalibrateReport& report) {
  config.fixed.clear();
  config.board_shape = BoardShape::given;
  BundleProblem problem;
  (void)set_up_problem(board, config, {report.camera.width_px, report.camera.height_px}, problem);
  problem.prior_information.setZero();
  std::vector<ViewArrays> arrays;
  BundleState state{report.camera.lens, {}, report.board_points};
  for (const BoardView& view : used_views(views, report, views.size())) arrays.push_back(make_arrays(view));
  for (const ViewFit& view : report.views) {
    if (view.used) state.cam_from_board.push_back(view.cam_from_board);
  }
  problem.views = arrays;
  NormalEquations eq;
  if (!linearize(problem, state, eq)) return {};
  std::vector<ViewScore> scores;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  for (const Eigen::Vector3d& point : report.board_points)
    middle += point / static_cast<double>(report.board_points.size());
  for (std::size_t k = 0; k < arrays.size(); ++k) {
    const Llt V(eq.V[k]);
    if (!V.is_positive()) return {};
    const Eigen::MatrixXd follows = V.solve_each(eq.coupling(k).transpose());  // the pose does
    const auto of_view = eq.dense_of(k);
    scores.push_back({of_view.leftCols(eq.num_dense) - eq.coupling(k) * follows,
                      of_view.col(eq.num_dense) - follows.transpose() * eq.pose_gradient[k],
                      (state.cam_from_board[k] * middle).z()});
  }
  return scores;
}

LensSplit split_of(const CalibrateReport& report) {
  LensSplit split;
  for (Eigen::Index i = 0; i < report.model_cov.rows(); ++i)
    (report.model_cov(i, i) > 0.0 ? split.free : split.fixed).push_back(i);
  return split;
}

}  // namespace alidade
