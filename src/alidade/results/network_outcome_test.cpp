#include "alidade/results/network_outcome.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <random>

#include "alidade/network.h"
#include "alidade/results/result_document.h"
#include "alidade/testing/moving_scene.h"

namespace alidade {
namespace {

/// It stood at the origin with σ 0.
TEST(NetworkOutcome, ACameraThatIsNotLocatedIsMissing) {
  testing::MovingScene scene = testing::scene_of(testing::loops, 1, false);
  std::mt19937 random(1);
  std::uniform_real_distribution<double> anywhere(100.0, 900.0);
  for (TargetObservation& observation : scene.observations)
    if (observation.head == 2) observation.px = {anywhere(random), anywhere(random)};
  const NetworkCalibration result =
      network(scene.observations, testing::unplaced(scene), {.distance = testing::true_distance(scene)});
  ASSERT_EQ(result.status, MovingTargetReport::Status::placed);
  EXPECT_EQ(result.covariance.rows(), 2 * num_head_params);
  EXPECT_EQ(result.parameter_names.size(), static_cast<std::size_t>(2 * num_head_params));
  const nlohmann::json document = nlohmann::json::parse(result_text(outcome_of(result).document));
  EXPECT_EQ(document["estimate"]["heads"].size(), 2u);
  EXPECT_EQ(document["stddev"]["heads"].size(), 2u);
  EXPECT_FALSE(document["estimate"]["cameras"][2]["placed"].get<bool>());
}

}  // namespace
}  // namespace alidade
