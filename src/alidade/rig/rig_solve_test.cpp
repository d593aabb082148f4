#include "alidade/rig/rig_solve.h"

#include <gtest/gtest.h>

#include "alidade/board/board.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/simulate/rig.h"

namespace alidade {
namespace {

struct Example {
  RigScene scene = draw_rig_scene({}, 5);
  std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
  RigProblem problem;
  RigState state;

  Example() {
    problem.points_in_board = points;
    problem.sigma_px = 0.3;
    problem.sigma_encoder_rad = 0.001;
    problem.free = {{8, 9, 10, 11, 12, 13, 14, 17, 18, 19, 20, 21, 22, 23},
                    {0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, 14, 19, focal_param, centre_x_param, centre_y_param,
                     pan_backlash_param, tilt_backlash_param}};
    for (const HeadView& view : scene.views)
      problem.views.push_back(
          {&view, view.head == 1 ? 0u : 1u, static_cast<std::size_t>(view.board),
           problem.views.size() % 3 == 0 ? Eigen::Vector2d(0.5, -0.5) : Eigen::Vector2d(-0.5, 0.5)});
    state = {scene.rig.heads,
             scene.world_from_board,
             std::vector<Eigen::Vector2d>(scene.views.size(), Eigen::Vector2d(0.002, -0.001)),
             {Eigen::Vector2d::Zero(), Eigen::Vector2d(0.003, 0.004)}};
    state.heads[0].head.encoder.pan_sin_rad = 0.02;
  }
};

/// A step of one parameter of a head, or of what may be estimated beside it.
void move(RigState& state, std::size_t h, int param, double by) {
  Head& head = state.heads[h].head;
  if (param < num_head_params) {
    head = retract(head, by * HeadVector::Unit(param));
  } else if (param >= pan_backlash_param) {
    state.backlash_rad[h][param - pan_backlash_param] += by;
  } else {
    Camera& camera = state.heads[h].camera;
    Eigen::VectorXd lens = params(camera.lens);
    if (param == focal_param) lens.head<2>() *= 1.0 + by;
    if (param != focal_param) lens[param - focal_param + 1] += by;
    camera.lens = with_params(camera.lens, lens);
  }
}

TEST(RigSolve, JacobiansAreTheDerivatives) {
  const Example example;
  constexpr double step = 1e-6;
  int num_checked = 0;
  for (const std::size_t v : {std::size_t{0}, example.scene.views.size() - 1}) {
    const RigView& view = example.problem.views[v];
    const auto at = view_residuals(example.problem, example.state, v);
    ASSERT_TRUE(at);
    const auto expect = [&](auto&& move, const Eigen::VectorXd& column) {
      RigState plus = example.state, minus = example.state;
      move(plus, step);
      move(minus, -step);
      const auto above = view_residuals(example.problem, plus, v), below = view_residuals(example.problem, minus, v);
      ASSERT_TRUE(above && below);
      const Eigen::VectorXd slope = (above->r - below->r) / (2.0 * step);
      // Pixels of size 10³ over 0.3 px: rounding of 10⁻¹³·3·10³ a step, a number of √108 rows.
      EXPECT_LE((slope - column).norm(), 1e-6 * column.norm() + 1e-4);
      ++num_checked;
    };
    const std::vector<int>& free = example.problem.free[view.head];
    for (std::size_t k = 0; k < free.size(); ++k)
      expect([&](RigState& state, double by) { move(state, view.head, free[k], by); },
             at->J_head.col(static_cast<Eigen::Index>(k)));
    for (int k = 0; k < 6; ++k)
      expect(
          [&](RigState& state, double by) {
            Rigid3& board = state.world_from_board[view.board];
            board = board.retract(by * Eigen::Matrix<double, 6, 1>::Unit(k));
          },
          at->J_board.col(k));
    for (int k = 0; k < 2; ++k)
      expect([&](RigState& state, double by) { state.corrections_rad[v][k] += by; }, at->J_correction.col(k));
  }
  EXPECT_EQ(num_checked, 14 + 19 + 2 * 8);
}

/// Of everything at once, without eliminating anything.
TEST(RigSolve, CovarianceIsThatOfTheWholeInformation) {
  Example example;
  example.problem.free[0] = {8, 9, 10, 11, 12, 13, 14, 17, 18, 19};
  example.problem.free[1] = {0, 1, 2, 3, 4, 5, 8, 9, 10, 11, 12, 13, 14, 19, focal_param, pan_backlash_param};
  const auto num_views = static_cast<Eigen::Index>(example.scene.views.size());
  const auto num_boards = static_cast<Eigen::Index>(example.scene.world_from_board.size());
  const Eigen::Index common = example.problem.num_free(), boards = common, corrections = boards + 6 * num_boards;
  Eigen::MatrixXd H = Eigen::MatrixXd::Zero(corrections + 2 * num_views, corrections + 2 * num_views);
  for (Eigen::Index v = 0; v < num_views; ++v) {
    const RigView& view = example.problem.views[static_cast<std::size_t>(v)];
    const auto at = view_residuals(example.problem, example.state, static_cast<std::size_t>(v));
    ASSERT_TRUE(at);
    Eigen::MatrixXd J = Eigen::MatrixXd::Zero(at->r.size(), H.cols());
    J.middleCols(example.problem.first_free(view.head), at->J_head.cols()) = at->J_head;
    J.middleCols(boards + 6 * static_cast<Eigen::Index>(view.board), 6) = at->J_board;
    J.middleCols(corrections + 2 * v, 2) = at->J_correction;
    H += J.transpose() * J;
  }
  const Eigen::MatrixXd whole = inverse_symmetric(H);
  const std::vector<double> weights(example.scene.views.size(), 1.0);
  const auto solved = solve_rig(example.problem, example.state, weights, 0);
  ASSERT_TRUE(solved);
  const auto cov = rig_covariance(example.problem, *solved).cov;
  ASSERT_TRUE(cov);
  EXPECT_LE((*cov - whole.topLeftCorner(common, common)).norm(), 1e-6 * cov->norm());
  double held = 0.0;
  for (Eigen::Index k = corrections; k < whole.rows(); ++k) held += whole(k, k) / 1e-6;
  EXPECT_NEAR(num_fixed_corrections(example.problem, *solved, *cov, weights), held, 1e-6 * held);
}

}  // namespace
}  // namespace alidade
