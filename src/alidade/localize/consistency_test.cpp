#include <gtest/gtest.h>

#include "alidade/localize/world_turn.h"
#include "alidade/testing/desk_walk.h"

namespace alidade {
namespace {

TEST(Consistency, TheUnturnedPlaceAndItsDerivativeBelongTogether) {
  const Rigid3 world_from_cam{exp_so3({0.3, -0.2, 0.5}), {0.1, 0.2, -0.7}};
  Feature feature;
  feature.kind = FeatureKind::inverse_depth;
  feature.values << 0.1, -0.2, 0.3, 0.4, -0.3, 1.2;
  const std::array<double, 6> no_error{};
  const Eigen::Matrix3d R = world_from_cam.rotation.toRotationMatrix();
  constexpr double h = 1e-6;
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d turn = h * Eigen::Vector3d::Unit(axis);
    const WorldTurn there(world_from_cam, R.transpose() * turn);
    const Feature moved = there.feature_before(feature, no_error);
    const Eigen::Vector<double, 6> numeric = (moved.values - feature.values) / h;
    EXPECT_LT((numeric - J_before_turn(feature).col(axis)).norm(), 1e-6);
    // Turned back, it is where it was: an error of the rotation alone moves nothing else.
    EXPECT_LT((WorldTurn::turned(there.G(), moved).values - feature.values).norm(), 1e-11);
  }
}

/// 500 frames of a camera that starts in front of a small flat target: what it says of its pose in the target's frame
/// holds to the end. A filter with errors counted from its own estimates has 600 here.
TEST(Consistency, ThePoseIsAsGoodAsItsCovarianceSaysOverHundredsOfFrames) {
  constexpr int num_seeds = 6;
  testing::DeskWalk walk;
  walk.filter = testing::desk_filter();
  double pose_nees = 0.0, position_nees = 0.0;
  for (std::uint64_t seed = 1; seed <= num_seeds; ++seed) {
    const testing::DeskRun run = testing::DeskWalker(walk, seed).run();
    for (std::size_t k = 0; k < run.pose_nees.size(); ++k) {
      const double share = 1.0 / (num_seeds * static_cast<double>(run.pose_nees.size()));
      pose_nees += share * run.pose_nees[k];
      position_nees += share * run.position_nees[k];
    }
    EXPECT_LT(run.error_m, 4.0 * run.sigma_m) << seed;
    EXPECT_GT(run.nis_per_dof, 0.8) << seed;
    EXPECT_LT(run.nis_per_dof, 1.2) << seed;
  }
  EXPECT_GT(pose_nees, 0.5);
  EXPECT_LT(pose_nees, 1.8);
  EXPECT_GT(position_nees, 0.3);  // the frame's error is one draw a run: six of them scatter
  EXPECT_LT(position_nees, 2.5);
}

}  // namespace
}  // namespace alidade
