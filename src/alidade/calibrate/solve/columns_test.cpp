#include "alidade/calibrate/solve/columns.h"

#include <gtest/gtest.h>

#include "alidade/board/board.h"
#include "alidade/calibrate/solve/normal_equations.h"
#include "alidade/testing/random.h"

namespace alidade {
namespace {

Lens example(const std::string& model) {
  const Lens lens = *make_lens(model);
  Eigen::VectorXd values(params(lens).size());
  if (model == "pinhole") values << 800, 810, 400, 300, 2;
  if (model == "brown") values << 800, 810, 400, 300, 2, -0.2, 0.08, 1e-3, -5e-4, 0.01;
  if (model == "kannala_brandt") values << 500, 510, 400, 300, 1, 0.02, -0.005, 1e-3, -1e-4;
  return with_params(lens, values);
}

struct Setting {
  std::vector<Eigen::Vector3d> points;
  ViewArrays view;
  Rigid3 cam_from_board;
};

/// 11 corners (no multiple of a vector), one of them rejected, with full covariances.
Setting draw_setting(std::mt19937_64& rng) {
  std::uniform_real_distribution<> uniform(-1.0, 1.0);
  Setting s;
  BoardView view;
  for (int i = 0; i < 11; ++i) {
    s.points.emplace_back(0.3 * uniform(rng), 0.2 * uniform(rng), 0.01 * uniform(rng));
    view.corners.push_back({i, {400 + 200 * uniform(rng), 300 + 200 * uniform(rng)}});
  }
  s.view = make_arrays(view);
  for (std::size_t i = 0; i < s.view.size(); ++i) {
    Eigen::Matrix2d cov;
    cov << 0.04, 0.01 * uniform(rng), 0.0, 0.09;
    cov(1, 0) = cov(0, 1);
    set_whitener(s.view, i, cov, i == 3 ? 0.0 : 1.0);
  }
  s.cam_from_board = {exp_so3({0.3 * uniform(rng), 0.3 * uniform(rng), uniform(rng)}), {0.05, -0.03, 1.0}};
  return s;
}

class ColumnsOfModel : public ::testing::TestWithParam<std::string> {};

TEST_P(ColumnsOfModel, AreTheDerivativesOfTheWhitenedResidual) {
  auto rng = testing::make_rng();
  int checked = 0;
  for (int trial = 0; trial < 20; ++trial) {
    const Lens lens = example(GetParam());
    const Setting s = draw_setting(rng);
    Columns at, ahead, behind;
    const PointArrays points = make_arrays(s.points);
    ASSERT_TRUE(fill_columns(prepare(lens), s.cam_from_board, points, s.view, at));
    const auto compare = [&](int column, double h) {
      for (std::size_t row = 0; row < at.num_rows(); ++row) {
        const double numeric = (ahead[Columns::residual][row] - behind[Columns::residual][row]) / (2 * h);
        EXPECT_NEAR(at[column][row], numeric, 1e-4 * (1.0 + std::abs(numeric))) << "column " << column;
        ++checked;
      }
    };
    for (int k = 0; k < params(lens).size(); ++k) {
      const double h = k < 5 ? 1e-3 : 1e-6;  // px, or a distortion coefficient
      Eigen::VectorXd step = Eigen::VectorXd::Zero(params(lens).size());
      step[k] = h;
      ASSERT_TRUE(
          fill_columns(prepare(with_params(lens, params(lens) + step)), s.cam_from_board, points, s.view, ahead));
      ASSERT_TRUE(
          fill_columns(prepare(with_params(lens, params(lens) - step)), s.cam_from_board, points, s.view, behind));
      compare(k, h);
    }
    for (int k = 0; k < 6; ++k) {
      constexpr double h = 1e-6;
      const Eigen::Vector<double, 6> step = h * Eigen::Vector<double, 6>::Unit(k);
      ASSERT_TRUE(fill_columns(prepare(lens), s.cam_from_board.retract(step), points, s.view, ahead));
      ASSERT_TRUE(fill_columns(prepare(lens), s.cam_from_board.retract(-step), points, s.view, behind));
      compare(Columns::pose + k, h);
    }
  }
  EXPECT_EQ(checked, 20 * static_cast<int>(params(example(GetParam())).size() + 6) * 24);
}

TEST_P(ColumnsOfModel, RefuseABoardBehindTheCamera) {
  auto rng = testing::make_rng();
  Setting s = draw_setting(rng);
  s.cam_from_board.translation.z() = GetParam() == "kannala_brandt" ? std::nan("") : -1.0;
  Columns columns;
  EXPECT_FALSE(fill_columns(prepare(example(GetParam())), s.cam_from_board, make_arrays(s.points), s.view, columns));
}

INSTANTIATE_TEST_SUITE_P(Models, ColumnsOfModel, ::testing::Values("pinhole", "brown", "kannala_brandt"));

TEST(Gram, EqualsTheMatrixProduct) {
  auto rng = testing::make_rng();
  std::normal_distribution<> normal;
  constexpr int m = 20, rows = 64;
  Eigen::MatrixXd A(rows, m);
  for (double& value : A.reshaped()) value = normal(rng);
  std::vector<const double*> columns;
  for (int j = 0; j < m; ++j) columns.push_back(A.col(j).data());
  Eigen::Matrix<double, m, m, Eigen::RowMajor> product;
  gram(columns.data(), m, rows, product.data());
  const Eigen::MatrixXd expected = A.transpose() * A;
  for (int i = 0; i < m; ++i) {
    for (int j = i; j < m; ++j) EXPECT_NEAR(product(i, j), expected(i, j), 1e-12 * rows);
  }
}

TEST(GaugeDirections, AreOrthonormalAndMoveTheBoardRigidly) {
  const Board board{.cols = 5, .rows = 4};
  const auto points = points_in_board(board);
  const Eigen::MatrixXd gauge = gauge_directions(points);
  EXPECT_LT((gauge * gauge.transpose() - Eigen::MatrixXd::Identity(7, 7)).norm(), 1e-12);
  // A small rotation about any axis and a small scaling lie in the row space.
  Eigen::VectorXd moved(3 * static_cast<Eigen::Index>(points.size()));
  for (std::size_t i = 0; i < points.size(); ++i) {
    moved.segment<3>(3 * static_cast<Eigen::Index>(i)) =
        Eigen::Vector3d(1, 2, 3).cross(points[i]) + 0.7 * points[i] + Eigen::Vector3d(0.1, 0.2, -0.4);
  }
  EXPECT_LT((moved - gauge.transpose() * (gauge * moved)).norm(), 1e-12);
}

}  // namespace
}  // namespace alidade
