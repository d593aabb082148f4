#include "alidade/localize/map/repeated_places.h"

#include <gtest/gtest.h>

#include <random>

#include "alidade/geometry/rigid3.h"

namespace alidade {
namespace {

constexpr double sigma_m = 0.005, sigma_rad = 0.01;

Rigid3 drawn(std::mt19937_64& bits, double size_m, double size_rad) {
  std::normal_distribution<double> normal;
  Rigid3 pose;
  for (int k = 0; k < 3; ++k) pose.translation[k] = size_m * normal(bits);
  pose.rotation = exp_so3(size_rad * Eigen::Vector3d(normal(bits), normal(bits), normal(bits)));
  return pose;
}

StartHypothesis said(const Rigid3& pose) {
  StartHypothesis place;
  place.motion.world_from_cam = pose;
  place.cov.diagonal().head<3>().setConstant(sigma_m * sigma_m);
  place.cov.diagonal().segment<3>(3).setConstant(sigma_rad * sigma_rad);
  return place;
}

TEST(RepeatedPlaces, AWrongPathIsCorrectedInTheSameWayByEach) {
  std::mt19937_64 bits(1);
  const Rigid3 correction = drawn(bits, 0.3, 0.5);
  RepeatedPlaces places;
  Rigid3 path = drawn(bits, 1.0, 1.0);
  for (std::size_t frame = 0; frame < 20; ++frame) {
    path = path * drawn(bits, 0.02, 0.02);
    const StartHypothesis place = said(correction * path * drawn(bits, sigma_m, sigma_rad));
    EXPECT_EQ(places.add({&place, 1}, path, frame), frame);
    EXPECT_EQ(places.add({&place, 1}, path, frame), frame);  // of the same frame: said once
  }
}

TEST(RepeatedPlaces, ChancePosesAreDifferentCorrections) {
  std::mt19937_64 bits(2);
  RepeatedPlaces places;
  Rigid3 path = drawn(bits, 1.0, 1.0);
  std::size_t num = 0;
  for (std::size_t frame = 0; frame < 300; ++frame) {
    path = path * drawn(bits, 0.02, 0.02);
    const StartHypothesis place = said(path * drawn(bits, 0.3, 0.5));
    num += places.add({&place, 1}, path, frame) > 0 ? 1 : 0;
  }
  EXPECT_LE(num, 3u);
}

TEST(RepeatedPlaces, WhatIsLongAgoDoesNotCount) {
  RepeatedPlaces places;
  const StartHypothesis place = said(Rigid3{});
  EXPECT_EQ(places.add({&place, 1}, Rigid3{}, 0), 0u);
  EXPECT_EQ(places.add({&place, 1}, Rigid3{}, 60), 1u);
  EXPECT_EQ(places.add({&place, 1}, Rigid3{}, 121), 0u);
}

}  // namespace
}  // namespace alidade
