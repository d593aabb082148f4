#include "alidade/localize/filter/fitted_frame.h"

#include <gtest/gtest.h>

#include "alidade/testing/localize_sample.h"

namespace alidade {
namespace {

Feature known(const Eigen::Vector3d& given, const Eigen::Vector3d& is, double sigma_m) {
  Feature feature;
  feature.is_known = feature.was_used = true;
  feature.given_in_world = given;
  feature.sigma_given_m = sigma_m;
  feature.values.head<3>() = is;
  return feature;
}

/// Four corners of a board, displaced, rotated and enlarged by little.
std::vector<Feature> displaced_board() {
  const Eigen::Matrix3d G = exp_so3({0.002, -0.001, 0.003}).toRotationMatrix();
  std::vector<Feature> features;
  for (const Eigen::Vector3d& corner :
       {Eigen::Vector3d(0.0, 0.0, 0.0), {0.3, 0.0, 0.0}, {0.3, 0.2, 0.0}, {0.0, 0.2, 0.0}})
    features.push_back(known(corner, 1.004 * (G * corner) + Eigen::Vector3d(0.004, -0.003, 0.002), 0.001));
  return features;
}

TEST(FittedFrame, TakesAWorldBackToWhereItsPointsWereGiven) {
  std::vector<Feature> features = displaced_board();
  Feature unused = known({1.0, 1.0, 1.0}, {2.0, 2.0, 2.0}, 0.001);
  unused.was_used = false;
  features.push_back(unused);
  const auto frame = fitted_frame(features);
  ASSERT_TRUE(frame);
  EXPECT_GT(frame->chi2, 10.0);
  for (Feature& feature : features)
    if (feature.was_used) feature = *frame * feature;
  for (const Feature& feature : features)
    if (feature.was_used) EXPECT_LT((feature.values.head<3>() - feature.given_in_world).norm(), 1e-5);
  EXPECT_LT(fitted_frame(features)->chi2, 1e-3);
}

TEST(FittedFrame, WeighsEachPointByItsSigma) {
  std::vector<Feature> features = displaced_board();
  for (Feature& feature : features) feature.values.head<3>() = feature.given_in_world;
  features[0].values.z() += 0.001;
  const auto alike = fitted_frame(features);
  features[0].sigma_given_m = 0.01;
  const auto vague = fitted_frame(features);
  ASSERT_TRUE(alike && vague);
  const auto moves = [](const FittedFrame& frame) { return (frame * Eigen::Vector3d(0.3, 0.2, 0.0)).z(); };
  EXPECT_GT(std::abs(moves(*alike)), 20.0 * std::abs(moves(*vague)));
}

TEST(FittedFrame, NeedsThreePointsThatAreNotOnALine) {
  std::vector<Feature> features = displaced_board();
  EXPECT_FALSE(fitted_frame(std::span(features).first(2)));
  EXPECT_TRUE(fitted_frame(std::span(features).first(3)));
  std::vector<Feature> line;
  for (int i = 0; i < 5; ++i) line.push_back(known({0.1 * i, 0.0, 0.0}, {0.1 * i, 0.0, 1e-4 * i}, 0.001));
  EXPECT_FALSE(fitted_frame(line));
}

/// A plain EKF's frame and scale drift; taking that back changes nothing that is expected of an observation.
TEST(FittedFrame, WhatIsSeenStaysAsItWas) {
  UnderwaterScene scene;
  scene.camera = underwater_camera();
  scene.num_points = 20;
  scene.num_frames = 40;
  const auto sample = testing::underwater_sample(scene, 5);
  LocalizationFilter filter(sample.camera, sample.config.start->motion, sample.config.start->cov,
                            {.holds_frame = false});
  for (const KnownPoint& point : sample.config.target.points)
    ASSERT_TRUE(filter.add_known(point.id, point.point_in_world, point.sigma_m));
  for (std::size_t k = 0; k < sample.frames.size(); ++k) {
    if (k > 0) filter.predict(0.1);
    (void)filter.update(sample.frames[k].observations);
    for (const FeatureObservation& observation : sample.frames[k].observations)
      if (!filter.has(observation.id)) filter.add(observation.id, observation.px, {0.7, 0.3});
  }
  const LocalizationFilter before = filter;
  ASSERT_TRUE(fitted_frame(filter.features()));
  EXPECT_GT(fitted_frame(filter.features())->chi2, 0.1);
  filter.fit_frame();
  EXPECT_LT(fitted_frame(filter.features())->chi2, 1e-3);
  const Rigid3 was = before.motion().world_from_cam, is = filter.motion().world_from_cam;
  EXPECT_GT((is.translation - was.translation).norm(), 1e-5);
  EXPECT_NEAR(filter.covariance().at(0, 0), before.covariance().at(0, 0), 0.05 * before.covariance().at(0, 0));
  std::size_t num = 0;
  for (const Feature& feature : before.features()) {
    const auto there = before.expected(feature.id), here = filter.expected(feature.id);
    ASSERT_TRUE(there && here);
    EXPECT_LT((there->px - here->px).norm(), 1e-9);
    EXPECT_LT((there->S - here->S).norm(), 1e-9 * there->S.norm());
    ++num;
  }
  EXPECT_GT(num, 15u);
}

}  // namespace
}  // namespace alidade
