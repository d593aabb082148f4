#include "alidade/estimation/interacting_models.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(InteractingModels, ProbabilitiesFollowTheChain) {
  InteractingModels models;
  const Eigen::Matrix3d step = models.transition_probabilities(0.05), one = Eigen::Matrix3d::Identity();
  EXPECT_LT((models.transition_probabilities(0.15) - step * step * step).norm(), 1e-12);
  EXPECT_LT((models.transition_probabilities(0.0) - one).norm(), 1e-12);
  const Eigen::Matrix3d half = models.transition_probabilities(0.025);
  EXPECT_LT((half * half - step).norm(), 1e-12);
  EXPECT_LT((step.rowwise().sum() - Eigen::Vector3d::Ones()).norm(), 1e-12);
  EXPECT_GT(models.transition_probabilities(40.0).minCoeff(), 0.01);
  // Without falls it is the chain of two: 0.03 and 0.06 in 0.05 s.
  models.to_falling_per_s = 0.0;
  const Eigen::Matrix2d two = models.transition_probabilities(0.05).topLeftCorner<2, 2>();
  EXPECT_LT((two - (Eigen::Matrix2d() << 0.97, 0.03, 0.06, 0.94).finished()).norm(), 1e-6);
}

TEST(InteractingModels, TheLikelierModelGainsAndNoneIsLostForGood) {
  InteractingBelief belief;
  Innovation likely, unlikely;
  unlikely.nis = 2000.0;
  belief.weigh(unlikely, likely, unlikely);
  EXPECT_GT(belief.mu[1], 0.999);
  EXPECT_GE(belief.mu[0], 0.99e-4);
  for (int i = 0; i < 3; ++i) belief.weigh(likely, unlikely, unlikely);
  EXPECT_GT(belief.mu[0], 0.999);
  for (int i = 0; i < 3; ++i) belief.weigh(unlikely, unlikely, likely);
  EXPECT_GT(belief.mu[2], 0.999);
}

TEST(InteractingModels, MergedIsTheMixturesMeanAndCovariance) {
  InteractingBelief belief;
  belief.mu = {0.25, 0.5, 0.25};
  belief.quiet.x[0] = 4.0;
  const Belief<6> merged = belief.merged();
  EXPECT_DOUBLE_EQ(merged.x[0], 1.0);
  EXPECT_DOUBLE_EQ(merged.P(0, 0), 1.0 + 0.25 * 0.75 * 16.0);
  EXPECT_DOUBLE_EQ(merged.P(1, 1), 1.0);
  EXPECT_EQ(belief.mean(), merged.x);
}

}  // namespace
}  // namespace alidade
