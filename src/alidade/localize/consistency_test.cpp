#include <gtest/gtest.h>

#include <Eigen/Cholesky>
#include <string>

#include "alidade/geometry/decompositions.h"
#include "alidade/localize/filter/world_rotation.h"
#include "alidade/testing/desk_walk.h"
#include "alidade/testing/localize_sample.h"

namespace alidade {
namespace {

/// How the whole state changes as the world rotates about its origin, as it is moved, and as it grows: by finite
/// differences.
Eigen::MatrixXd gauge_of(const LocalizationFilter& filter) {
  Eigen::MatrixXd N = Eigen::MatrixXd::Zero(filter.dim(), 7);
  constexpr double h = 1e-6;
  const CameraMotion& motion = filter.motion();
  for (int axis = 0; axis < 3; ++axis) {
    const Eigen::Vector3d turn = h * Eigen::Vector3d::Unit(axis);
    const Eigen::Matrix3d G = exp_so3(turn).toRotationMatrix();
    const auto by = [&](const Eigen::Vector3d& place) { return ((G * place - place) / h).eval(); };
    N.block<3, 1>(0, axis) = by(motion.world_from_cam.translation);
    N.block<3, 1>(3, axis) = motion.world_from_cam.rotation.conjugate() * turn / h;
    N.block<3, 1>(6, axis) = by(motion.velocity_in_world);
    N(axis, 3 + axis) = 1.0;
    for (const Feature& feature : filter.features()) {
      N.block<3, 1>(feature.offset, axis) = by(feature.values.head<3>());
      N(feature.offset + axis, 3 + axis) = 1.0;
      if (feature.kind == FeatureKind::xyz) continue;
      const AnglesOfBearing angles = angles_of(G * bearing_of(feature.values[3], feature.values[4]).m);
      N(feature.offset + 3, axis) = (angles.theta - feature.values[3]) / h;
      N(feature.offset + 4, axis) = (angles.phi - feature.values[4]) / h;
    }
  }
  constexpr int scale = 6;
  N.block<3, 1>(0, scale) = motion.world_from_cam.translation;
  N.block<3, 1>(6, scale) = motion.velocity_in_world;
  for (const Feature& feature : filter.features()) {
    N.block<3, 1>(feature.offset, scale) = feature.values.head<3>();
    if (feature.kind == FeatureKind::inverse_depth) N(feature.offset + 5, scale) = -feature.values[5];
  }
  return N;
}

/// ln det of the information about the world's frame: by whatever numbers the frame is counted.
double information_of(const LocalizationFilter& filter) {
  const Eigen::MatrixXd N = gauge_of(filter), P = testing::covariance_of(filter);
  const Eigen::VectorXd sigma = P.diagonal().cwiseSqrt();  // state numbers have their own units
  const Eigen::MatrixXd C = sigma.cwiseInverse().asDiagonal() * P * sigma.cwiseInverse().asDiagonal();
  const Eigen::MatrixXd scaled = sigma.cwiseInverse().asDiagonal() * N;
  const Eigen::LLT<Eigen::MatrixXd> llt(C);
  const Eigen::MatrixXd information = scaled.transpose() * llt.solve(scaled);
  return std::log(information.determinant());
}

/// Without known points no observation determines where the world is, how it is rotated or how large it is: an update
/// changes what is known of that by nothing, though the state it is linearised at moves. With positions: inverse depths
/// that begin in one image share their first three components, and such a covariance has no inverse.
TEST(Consistency, NothingSeenTellsHowTheWorldIsRotatedOrHowLargeItIs) {
  UnderwaterScene scene;
  scene.camera = underwater_camera();
  scene.num_points = 20;
  scene.num_frames = 30;
  scene.sigma_depth = 0.05;
  const auto sample = testing::underwater_sample(scene, 11);
  MotionMatrix cov = sample.config.start->cov;
  cov.diagonal().head<6>().setConstant(0.05 * 0.05);
  LocalizationFilter filter(sample.camera, sample.config.start->motion, cov);
  double largest_turn_rad = 0.0;
  for (std::size_t k = 0; k < sample.frames.size(); ++k) {
    if (k > 0) {
      filter.predict(0.1);
      const double before = information_of(filter);
      const Eigen::Quaterniond was = filter.motion().world_from_cam.rotation;
      ASSERT_TRUE(filter.update(sample.frames[k].observations).is_sound);
      largest_turn_rad = std::max(largest_turn_rad, was.angularDistance(filter.motion().world_from_cam.rotation));
      EXPECT_NEAR(information_of(filter), before, 1e-3) << k;
    }
    for (const FeatureObservation& observation : sample.frames[k].observations) {
      const auto given = std::ranges::find(sample.config.start->depths, observation.id, &GivenDepth::id);
      if (filter.has(observation.id) || given == sample.config.start->depths.end()) continue;
      const double range_m = given->depth_m / unproject(filter.camera(), observation.px)->z();
      filter.add(observation.id, observation.px, {range_m, given->sigma_rel}, FeatureKind::xyz);
    }
  }
  EXPECT_GT(largest_turn_rad, 0.005);  // the updates did something
}

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
    const WorldRotation there(world_from_cam, R.transpose() * turn);
    const Feature moved = there.feature_before(feature, no_error);
    const Eigen::Vector<double, 6> numeric = (moved.values - feature.values) / h;
    EXPECT_LT((numeric - J_before_rotation(feature).col(axis)).norm(), 1e-6);
    // Rotated back, it is where it was: an error of the rotation alone moves nothing else.
    EXPECT_LT((WorldRotation::turned(there.G(), moved).values - feature.values).norm(), 1e-11);
  }
}

/// 500 frames of a camera that starts in front of a small flat target: what it says of its pose in the target's frame
/// holds to the end. One that forgets that nothing seen determines how the world is rotated has 100 and more here. What
/// is above 1 is left by the first frames, whose rotations are large while depths are vague.
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
  RecordProperty("pose_nees", std::to_string(pose_nees));
  RecordProperty("position_nees", std::to_string(position_nees));
  EXPECT_GT(pose_nees, 0.5);
  EXPECT_LT(pose_nees, 1.8);
  EXPECT_GT(position_nees, 0.3);  // the frame's error is one draw a run: six of them scatter
  EXPECT_LT(position_nees, 2.5);
}

}  // namespace
}  // namespace alidade
