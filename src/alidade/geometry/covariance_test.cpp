#include "alidade/geometry/covariance.h"

#include <gtest/gtest.h>

#include <cmath>

namespace alidade {
namespace {

TEST(Covariance, IsSymmetricWithoutNegativeVariance) {
  const Eigen::Vector3d sigma(1e-9, 1.0, 1e12);  // units differ by decades
  Eigen::Matrix3d correlation = Eigen::Matrix3d::Identity();
  correlation(0, 1) = correlation(1, 0) = 0.9;
  const auto with = [&sigma](const Eigen::Matrix3d& of_correlations) {
    return is_covariance(sigma.asDiagonal() * of_correlations * sigma.asDiagonal());
  };
  EXPECT_TRUE(is_covariance(Eigen::MatrixXd(0, 0)));
  EXPECT_TRUE(is_covariance(Eigen::MatrixXd::Zero(4, 4)));
  EXPECT_TRUE(with(correlation));
  EXPECT_FALSE(is_covariance(-Eigen::MatrixXd::Identity(3, 3)));
  EXPECT_FALSE(is_covariance(Eigen::MatrixXd::Identity(3, 2)));
  EXPECT_FALSE(is_covariance(Eigen::MatrixXd::Constant(2, 2, std::nan(""))));
  correlation(1, 0) = 0.8;
  EXPECT_FALSE(with(correlation)) << "not symmetric";
  correlation(0, 1) = correlation(1, 0) = 1.01;
  EXPECT_FALSE(with(correlation)) << "correlated by more than 1";
  correlation.setConstant(-0.9);
  correlation.diagonal().setOnes();
  EXPECT_FALSE(with(correlation)) << "three that all contradict each other";
}

}  // namespace
}  // namespace alidade
