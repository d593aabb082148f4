#include <gtest/gtest.h>

#include <cmath>

#include "alidade/observe/solve/solve.h"

// What the residuals ask for and could not be freed is in the answer's σ: an untold lever of 5 cm beside a noisy
// rotation left fx ◆ and 9σ off.

namespace alidade {
namespace {

/// fx, fy, cx, cy and an encoder's scale, each with its σ.
ObserveSolution answered() {
  ObserveSolution report;
  report.scale.scale = 300.0;
  const Eigen::VectorXd sigma{{0.5, 0.6, 1.0, 1.1, 2e-4}};
  report.covariance = sigma.cwiseAbs2().asDiagonal();
  for (const char* name : {"fx", "fy", "cx", "cy", "scale_pan"})
    report.quantities.push_back({name, 1.0, sigma[std::ssize(report.quantities)], 0.0, 0.0});
  report.steps.resize(2);
  for (IntrinsicsEstimate& row : report.steps) row.sigma = sigma.head<4>();
  return report;
}

RotationError scale_of_pan() {
  RotationError error;
  error.quantity = "scale_pan";
  error.ordinary = 1e-3;
  return error;
}

TEST(LeftCauses, AreInTheSigma) {
  ObserveSolution report = answered();
  CauseScore left;
  left.shift = CommonVector(Eigen::VectorXd{{0.02, 0.02, 0.0, -0.01, 0.3}});  // 6, 6, 0, −3 px; 0.0003
  count_left(&left, {scale_of_pan()}, report);
  const Eigen::VectorXd sigma{
      {std::hypot(0.5, 6.0), std::hypot(0.6, 6.0), 1.0, std::hypot(1.1, 3.0), std::hypot(2e-4, 3e-4)}};
  for (Eigen::Index i = 0; i < 5; ++i)
    EXPECT_NEAR(report.quantities[static_cast<std::size_t>(i)].sigma, sigma[i], 1e-12) << i;
  EXPECT_NEAR(report.covariance(0, 3), -6.0 * 3.0, 1e-12);
  EXPECT_NEAR(report.covariance(0, 4), 6.0 * 3e-4, 1e-12);
  for (const IntrinsicsEstimate& row : report.steps) EXPECT_TRUE(row.sigma.isApprox(sigma.head<4>(), 1e-12));
}

TEST(LeftCauses, NoneChangesNothing) {
  ObserveSolution report = answered();
  const Eigen::MatrixXd before = report.covariance;
  count_left(nullptr, {scale_of_pan()}, report);
  CauseScore of_another_layout;
  of_another_layout.shift = CommonVector(Eigen::VectorXd::Ones(6));
  count_left(&of_another_layout, {scale_of_pan()}, report);
  EXPECT_EQ(report.covariance, before);
  EXPECT_EQ(report.quantities.front().sigma, 0.5);
}

}  // namespace
}  // namespace alidade
