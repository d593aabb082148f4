#include "alidade/estimation/interacting_models.h"

#include <gtest/gtest.h>

namespace alidade {
namespace {

TEST(InteractingModels, ProbabilitiesFollowTheChain) {
  const InteractingModels models;
  const Eigen::Matrix2d step = (Eigen::Matrix2d() << 0.97, 0.03, 0.06, 0.94).finished();
  EXPECT_LT((models.transition_probabilities(0.05) - step).norm(), 1e-14);
  EXPECT_LT((models.transition_probabilities(0.15) - step * step * step).norm(), 1e-14);
  EXPECT_LT((models.transition_probabilities(0.0) - Eigen::Matrix2d::Identity()).norm(), 1e-14);
  const Eigen::Matrix2d half = models.transition_probabilities(0.025);
  EXPECT_LT((half * half - step).norm(), 1e-14);
}

TEST(InteractingModels, TheLikelierModelGainsAndNoneIsLostForGood) {
  InteractingBelief belief;
  Innovation likely, unlikely;
  unlikely.nis = 2000.0;
  belief.weigh(unlikely, likely);
  EXPECT_GT(belief.mu[1], 0.999);
  EXPECT_GE(belief.mu[0], 0.99e-4);
  for (int i = 0; i < 3; ++i) belief.weigh(likely, unlikely);
  EXPECT_GT(belief.mu[0], 0.999);
}

TEST(InteractingModels, MergedIsTheMixturesMeanAndCovariance) {
  InteractingBelief belief;
  belief.mu = {0.25, 0.75};
  belief.quiet.x[0] = 4.0;
  const Belief<6> merged = belief.merged();
  EXPECT_DOUBLE_EQ(merged.x[0], 1.0);
  EXPECT_DOUBLE_EQ(merged.P(0, 0), 1.0 + 0.25 * 0.75 * 16.0);
  EXPECT_DOUBLE_EQ(merged.P(1, 1), 1.0);
}

}  // namespace
}  // namespace alidade
