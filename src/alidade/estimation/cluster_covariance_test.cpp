#include "alidade/estimation/cluster_covariance.h"

#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <Eigen/QR>
#include <cmath>

#include "alidade/testing/random.h"

namespace alidade {
namespace {

using Eigen::MatrixXd;
using Eigen::VectorXd;

std::mt19937_64 seeded(std::uint64_t seed) {
  std::mt19937_64 random = testing::make_rng();
  random.discard(1000 * seed);
  return random;
}

/// y = X θ + noise, in clusters of rows; by least squares, whitened by the rows' own σ = 1.
struct Regression {
  std::vector<MatrixXd> X;
  std::vector<VectorXd> y;
  VectorXd estimate;
  MatrixXd inverse;
  double noise_variance = 1.0;
  std::vector<ClusterStep> steps;

  void solve(const MatrixXd& prior = {}) {
    const Eigen::Index n = X.front().cols();
    MatrixXd H = prior.size() > 0 ? prior : MatrixXd(MatrixXd::Zero(n, n));
    VectorXd g = VectorXd::Zero(n);
    double rows = 0.0;
    for (std::size_t k = 0; k < X.size(); ++k) {
      H += X[k].transpose() * X[k];
      g += X[k].transpose() * y[k];
      rows += static_cast<double>(y[k].size());
    }
    inverse = H.llt().solve(MatrixXd::Identity(n, n));
    estimate = inverse * g;
    double sum = 0.0;
    steps.clear();
    for (std::size_t k = 0; k < X.size(); ++k) {
      const VectorXd r = X[k] * estimate - y[k];
      sum += r.squaredNorm();
      steps.push_back(cluster_step(inverse, X[k].transpose() * X[k], X[k].transpose() * r));
    }
    noise_variance = sum / (rows - static_cast<double>(n));
  }
};

constexpr int num_parameters = 4, rows_per_cluster = 30;

/// Truth is zero. Each cluster has `shared` σ of an error of its own along a random pattern of its rows.
Regression draw(int num_clusters, double shared, std::mt19937_64& random) {
  std::normal_distribution<double> normal;
  Regression drawn;
  for (int k = 0; k < num_clusters; ++k) {
    MatrixXd X(rows_per_cluster, num_parameters);
    for (Eigen::Index i = 0; i < X.size(); ++i) X.data()[i] = normal(random);
    VectorXd y(rows_per_cluster), pattern(num_parameters);
    for (Eigen::Index i = 0; i < pattern.size(); ++i) pattern[i] = shared * normal(random);
    for (Eigen::Index i = 0; i < y.size(); ++i) y[i] = normal(random);
    drawn.X.push_back(X);
    drawn.y.push_back(y + X * pattern);
  }
  drawn.solve();
  return drawn;
}

struct Coverage {
  double inside_1 = 0.0, inside_2 = 0.0, model_2 = 0.0, mean_inflation = 0.0, count = 0.0;
};

Coverage coverage(int num_clusters, double shared, int runs) {
  auto random = seeded(17);
  Coverage found;
  for (int run = 0; run < runs; ++run) {
    const Regression drawn = draw(num_clusters, shared, random);
    const ClusterCovariance robust = cluster_covariance(drawn.inverse, drawn.noise_variance, drawn.steps);
    for (Eigen::Index j = 0; j < num_parameters; ++j) {
      const double sigma = std::sqrt(robust.cov(j, j)), error = std::abs(drawn.estimate[j]);
      found.inside_1 += error < sigma ? 1.0 : 0.0;
      found.inside_2 += error < 2.0 * sigma ? 1.0 : 0.0;
      found.model_2 += error < 2.0 * sigma / robust.inflation[j] ? 1.0 : 0.0;
      found.mean_inflation += robust.inflation[j];
      found.count += 1.0;
    }
  }
  for (double* value : {&found.inside_1, &found.inside_2, &found.model_2, &found.mean_inflation}) *value /= found.count;
  return found;
}

// Normal errors: 68.3 and 95.4 % lie within 1 and 2σ. Of 4000 values each share scatters by 0.7 and 0.3 %.
TEST(ClusterCovariance, IndependentErrorsKeepTheModelsSigma) {
  for (const int clusters : {13, 40}) {
    const Coverage found = coverage(clusters, 0.0, 1000);
    EXPECT_NEAR(found.inside_1, 0.683, 0.04) << clusters;
    EXPECT_NEAR(found.inside_2, 0.954, 0.02) << clusters;
    EXPECT_LT(found.mean_inflation, 1.04) << clusters;
  }
}

TEST(ClusterCovariance, ErrorsSharedWithinClustersAreCovered) {
  for (const int clusters : {6, 13, 40}) {
    const Coverage found = coverage(clusters, 0.6, 1000);
    EXPECT_GT(found.inside_2, 0.90) << clusters;
    EXPECT_LT(found.inside_2, 0.98) << clusters;
    EXPECT_LT(found.model_2, 0.65) << clusters;  // single measurements alone would have it so
  }
}

// Six more parameters that all clusters share take their part of the residuals, though none is requested: of
// independent errors the scores' squares are 1 in the mean, as the trace of a projection has it.
TEST(ClusterCovariance, SharedParametersThatNoOneAsksForAreCounted) {
  auto random = seeded(21);
  std::normal_distribution<double> normal;
  constexpr int asked = 4, all = 10, clusters = 5, runs = 1500;
  double with_taken = 0.0, without = 0.0;
  for (int run = 0; run < runs; ++run) {
    Regression drawn;
    for (int k = 0; k < clusters; ++k) {
      drawn.X.push_back(MatrixXd::NullaryExpr(8, all, [&] { return normal(random); }));
      drawn.y.push_back(VectorXd::NullaryExpr(8, [&] { return normal(random); }));
    }
    drawn.solve();
    const MatrixXd inverse = drawn.inverse.topLeftCorner(asked, asked);
    std::vector<ClusterStep> steps;
    for (std::size_t k = 0; k < drawn.X.size(); ++k) {
      const MatrixXd pull = drawn.inverse.topRows(asked) * drawn.X[k].transpose() * drawn.X[k];
      steps.push_back({drawn.steps[k].step.head(asked), drawn.steps[k].spread.topLeftCorner(asked, asked),
                       pull * drawn.inverse * pull.transpose()});
    }
    with_taken += cluster_covariance(inverse, 1.0, steps).design_effect / runs;
    for (ClusterStep& step : steps) step.taken.resize(0, 0);
    without += cluster_covariance(inverse, 1.0, steps).design_effect / runs;
  }
  EXPECT_NEAR(with_taken, 1.0, 0.05);  // a design effect scatters by √(2/12): its mean by 0.011
  EXPECT_LT(without, 0.95);
}

TEST(ClusterCovariance, WhatAPriorTellsIsNotInflated) {
  auto random = seeded(3);
  Regression drawn = draw(13, 2.0, random);
  MatrixXd prior = MatrixXd::Zero(num_parameters, num_parameters);
  prior(2, 2) = 1e6;  // σ 0.001, a hundred times the rows' information
  drawn.solve(prior);
  const ClusterCovariance robust = cluster_covariance(drawn.inverse, 1.0, drawn.steps);
  EXPECT_NEAR(robust.inflation[2], 1.0, 0.05);
  EXPECT_GT(robust.inflation[0], 3.0);
}

TEST(ClusterCovariance, WhitenedClustersSayTheSame) {
  auto random = seeded(4);
  for (const int clusters : {6, 13, 120}) {
    const Regression drawn = draw(clusters, 0.6, random);
    const MatrixXd L = drawn.inverse.llt().matrixL(), whiten = L.inverse();
    std::vector<ClusterStep> whitened;
    for (const ClusterStep& step : drawn.steps)
      whitened.push_back({whiten * step.step, whiten * step.spread * whiten.transpose(), {}});
    const ClusterCovariance one = cluster_covariance(drawn.inverse, drawn.noise_variance, drawn.steps);
    const ClusterCovariance other = whitened_cluster_covariance(L, drawn.noise_variance, whitened);
    EXPECT_LT((one.cov - other.cov).norm(), 1e-12 * one.cov.norm()) << clusters;
    EXPECT_GT(one.largest_inflation(), 1.2);
  }
}

TEST(ClusterCovariance, FixedParametersStayFixed) {
  auto random = seeded(5);
  const Regression drawn = draw(13, 1.0, random);
  MatrixXd inverse = MatrixXd::Zero(5, 5);
  const std::vector<Eigen::Index> at = {0, 1, 3, 4};
  inverse(at, at) = drawn.inverse;
  std::vector<ClusterStep> steps;
  for (const ClusterStep& step : drawn.steps) {
    steps.push_back({VectorXd::Zero(5), MatrixXd::Zero(5, 5)});
    steps.back().step(at) = step.step;
    steps.back().spread(at, at) = step.spread;
  }
  const ClusterCovariance with_fixed = cluster_covariance(inverse, drawn.noise_variance, steps);
  const ClusterCovariance without = cluster_covariance(drawn.inverse, drawn.noise_variance, drawn.steps);
  EXPECT_EQ(with_fixed.cov.row(2).norm(), 0.0);
  EXPECT_LT((with_fixed.cov(at, at) - without.cov).norm(), 1e-12 * without.cov.norm());
  EXPECT_EQ(with_fixed.inflation[2], 1.0);
}

TEST(ClusterCovariance, TooFewClustersGiveTheModels) {
  auto random = seeded(6);
  Regression drawn = draw(2, 1.0, random);
  const ClusterCovariance robust = cluster_covariance(drawn.inverse, drawn.noise_variance, drawn.steps);
  EXPECT_EQ(robust.cov, drawn.noise_variance * drawn.inverse);
  EXPECT_EQ(clusters_agree(robust, "shot", "", "shots").state, State::care);
}

// One cluster determines a parameter nearly alone, and the others weakly contradict it: σ extends to them.
TEST(ClusterCovariance, AnAnswerThatHangsOnOneClusterIsAsUncertainAsItsDeletion) {
  auto random = seeded(8);
  Regression drawn = draw(13, 0.0, random);
  for (std::size_t k = 0; k < drawn.X.size(); ++k) drawn.X[k].col(3) *= k == 0 ? 10.0 : 0.5;
  for (std::size_t k = 1; k < drawn.X.size(); ++k) drawn.y[k] += drawn.X[k].col(3) * 1.0;  // θ₃ = 1 by them, 0 by it
  drawn.solve();
  Regression others = drawn;
  others.X.erase(others.X.begin());
  others.y.erase(others.y.begin());
  others.solve();
  const ClusterCovariance robust = cluster_covariance(drawn.inverse, drawn.noise_variance, drawn.steps);
  const double change = std::abs(others.estimate[3] - drawn.estimate[3]);
  ASSERT_GT(change, 10.0 * std::sqrt(drawn.noise_variance * drawn.inverse(3, 3)));
  EXPECT_GT(std::sqrt(robust.cov(3, 3)), 0.7 * change);
}

TEST(ClusterCovariance, DegenerateInputAnswersWithTheModel) {
  const MatrixXd singular = MatrixXd::Ones(3, 3);
  const std::vector<ClusterStep> steps(5, {VectorXd::Ones(3), singular});
  EXPECT_EQ(cluster_covariance(singular, 1.0, steps).cov, singular);
  const std::vector<ClusterStep> not_finite(5, {VectorXd::Constant(3, std::nan("")), MatrixXd::Identity(3, 3)});
  EXPECT_EQ(cluster_covariance(MatrixXd::Identity(3, 3), 1.0, not_finite).cov, MatrixXd(MatrixXd::Identity(3, 3)));
  EXPECT_EQ(cluster_covariance(MatrixXd(0, 0), 1.0, {}).cov.size(), 0);
}

}  // namespace
}  // namespace alidade
