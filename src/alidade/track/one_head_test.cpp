#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <random>

#include "alidade/testing/track_sample.h"
#include "alidade/track/track.h"

// A target that one head alone sees.

namespace alidade {
namespace {

/// Slow and smooth, its acceleration lasting: about (0.2, 0, 2.5) m.
std::function<Eigen::Vector3d(double)> lasting_path(std::uint64_t seed) {
  std::mt19937_64 random(seed);
  const auto draw = [&random](double low, double high) { return std::uniform_real_distribution<>(low, high)(random); };
  Eigen::Vector3d amplitude, rate, phase;
  for (int k = 0; k < 3; ++k) {
    amplitude[k] = draw(0.2, 0.45);
    rate[k] = 2.0 * std::numbers::pi / draw(5.0, 10.0);
    phase[k] = draw(0.0, 2.0 * std::numbers::pi);
  }
  return [=](double t_s) -> Eigen::Vector3d {
    return Eigen::Vector3d(0.2, 0.0, 2.5) + amplitude.cwiseProduct((rate * t_s + phase).array().sin().matrix());
  };
}

/// Nothing corrects the range then: σ has the acceleration that lasts, not white noise alone.
TEST(OneHead, ItsRangeDriftsByAnAccelerationThatLasts) {
  constexpr int num = 24;
  double nees = 0.0, nees_of_both = 0.0;
  for (std::uint64_t seed = 1; seed <= num; ++seed) {
    TrackScene scene = *track_scenario("B");
    scene.position = lasting_path(seed);
    scene.duration_s = 4.0;
    const FollowConfig config;
    const auto end_of = [&] {
      const auto observations = testing::observations_of(scene, seed);
      return track_target(observations, scene.heads, config, testing::truth_of(scene)).nees.back() / 3.0;
    };
    nees_of_both += end_of() / num;
    scene.occlusions = {{1, 2.8, 4.0}};
    nees += end_of() / num;
  }
  EXPECT_LT(nees_of_both, 1.5);
  EXPECT_GT(nees_of_both, 0.5);
  EXPECT_LT(nees, 1.4);
  EXPECT_GT(nees, 0.3);
  RecordProperty("nees", std::to_string(nees));
}

}  // namespace
}  // namespace alidade
