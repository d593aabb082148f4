#include "alidade/observe/solve/bundle_normal.h"

#include <gtest/gtest.h>

#include <Eigen/LU>
#include <tuple>

#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

constexpr int num_common = 5;

Eigen::MatrixXd drawn(Draws& draws, Eigen::Index rows, Eigen::Index cols) {
  Eigen::MatrixXd M(rows, cols);
  for (Eigen::Index i = 0; i < M.size(); ++i) M.data()[i] = draws.normal();
  return M;
}

/// Normal equations of drawn Jacobians, and the same as one matrix: common, points, frames.
struct Drawn {
  BundleNormal normal;
  Eigen::MatrixXd information;
  Eigen::VectorXd gradient;

  Drawn(int num_points, int num_frames, bool walks, std::uint64_t seed) {
    Draws draws(seed);
    const int size = num_common + 3 * num_points + 3 * num_frames;
    information.setZero(size, size);
    gradient.setZero(size);
    const auto add = [&](const Eigen::MatrixXd& J, const Eigen::VectorXd& error) {
      information += J.transpose() * J;
      gradient += J.transpose() * error;
    };
    const auto point_at = [&](int i) { return num_common + 3 * i; };
    const auto frame_at = [&](int k) { return num_common + 3 * num_points + 3 * k; };
    for (int k = 0; k < num_frames; ++k) {
      for (int i = 0; i < num_points; ++i) {
        if ((i + k) % 3 == 0) continue;
        Eigen::MatrixXd J = Eigen::MatrixXd::Zero(4, size);
        J.leftCols(num_common) = drawn(draws, 4, num_common);
        J.middleCols(point_at(i), 3) = drawn(draws, 4, 3);
        J.middleCols(frame_at(k), 3) = drawn(draws, 4, 3);
        add(J, drawn(draws, 4, 1));
        normal.crossings.push_back({i, k, J.middleCols(point_at(i), 3).transpose() * J.middleCols(frame_at(k), 3)});
      }
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(3, size);
      J.middleCols(frame_at(k), 3) = 2.0 * Eigen::Matrix3d::Identity();
      if (walks && k > 0) J.middleCols(frame_at(k - 1), 3) = -2.0 * Eigen::Matrix3d::Identity();
      add(J, drawn(draws, 3, 1));
      if (walks) normal.walk.push_back(4.0);
    }
    normal.frames_are_measured = !walks;
    normal.common = information.topLeftCorner(num_common, num_common);
    normal.gradient = gradient.head(num_common);
    const auto block_at = [&](int at) {
      return NormalBlock{information.block<3, 3>(at, at), gradient.segment<3>(at),
                         information.block(at, 0, 3, num_common)};
    };
    for (int i = 0; i < num_points; ++i) normal.points.push_back(block_at(point_at(i)));
    for (int k = 0; k < num_frames; ++k) normal.frames.push_back(block_at(frame_at(k)));
  }
};

/// Whichever are eliminated first, it is the whole system solved at once.
TEST(BundleNormal, StepsAreThoseOfTheWholeSystem) {
  for (const auto& [points, frames, walks] :
       {std::tuple(9, 4, false), std::tuple(4, 9, false), std::tuple(4, 9, true)}) {
    const Drawn drawn(points, frames, walks, 7);
    for (const double damping : {0.0, 0.3}) {
      Eigen::MatrixXd damped = drawn.information;
      damped.diagonal() *= 1.0 + damping;
      const Eigen::VectorXd whole = -damped.fullPivLu().solve(drawn.gradient);
      const BundleStep step = bundle_step(drawn.normal, damping);
      Eigen::VectorXd all(whole.size());
      all.head(num_common) = step.common;
      Eigen::Index at = num_common;
      for (const auto* each : {&step.points, &step.frames})
        for (const Eigen::Vector3d& three : *each) all.segment<3>(at) = three, at += 3;
      ASSERT_EQ(at, all.size());
      EXPECT_LT((all - whole).norm(), 1e-7 * whole.norm()) << points << " points, " << frames << " frames";
    }
  }
}

TEST(BundleNormal, InformationOfTheCommonIsTheInverseOfTheirCovariance) {
  for (const auto& [points, frames, walks] :
       {std::tuple(9, 4, false), std::tuple(4, 9, false), std::tuple(4, 9, true)}) {
    const Drawn drawn(points, frames, walks, 8);
    const Eigen::MatrixXd cov = drawn.information.inverse().topLeftCorner(num_common, num_common);
    const CommonMatrix information = common_information(drawn.normal, CommonMatrix::Zero(num_common, num_common));
    EXPECT_LT((information * cov - Eigen::MatrixXd::Identity(num_common, num_common)).norm(), 1e-6);
  }
}

}  // namespace
}  // namespace alidade
