#include "alidade/network/camera_scores.h"

#include <gtest/gtest.h>

#include "alidade/network/moving_target.h"
#include "alidade/testing/moving_scene.h"

// A lens that is not its file's, a camera that was moved: each passed for other positions in ●.

namespace alidade {
namespace {

Verdict verdict_of(const testing::MovingScene& scene, const std::vector<RigHead>& heads) {
  const MovingTargetConfig config{.distance = testing::true_distance(scene)};
  return moving_target_verdict(place_cameras(scene.observations, heads, config), config);
}

TEST(MovingLenses, DistortionThatAFileLacksIsNamed) {
  for (const unsigned seed : {1U, 2U}) {
    const testing::MovingScene scene = testing::scene_of(testing::loops, seed, false);
    std::vector<RigHead> heads = testing::unplaced(scene);
    Camera& camera = heads[1].camera = with_distortion(heads[1].camera);
    Eigen::VectorXd lens = params(camera.lens);
    lens[5] += 0.03;
    camera.lens = with_params(camera.lens, lens);
    camera.cov.setZero(lens.size(), lens.size());
    const Verdict verdict = verdict_of(scene, heads);
    EXPECT_NE(verdict.state, State::good) << seed;
    EXPECT_NE(verdict.to_add.find("head 2: the observations ask for a distortion"), std::string::npos)
        << seed << ": " << verdict.sentence << verdict.to_add;
  }
}

TEST(MovingLenses, APrincipalPointElsewhereIsSeen) {
  for (const unsigned seed : {1U, 2U}) {
    const testing::MovingScene scene = testing::scene_of(testing::loops, seed, false);
    std::vector<RigHead> heads = testing::unplaced(scene);
    Eigen::VectorXd lens = params(heads[2].camera.lens);
    lens[2] += 30.0;
    heads[2].camera.lens = with_params(heads[2].camera.lens, lens);
    const Verdict verdict = verdict_of(scene, heads);
    EXPECT_NE(verdict.state, State::good) << seed << ": " << verdict.sentence;
  }
}

/// 10 ms of one camera were in the residuals of all, and the verdict was good.
TEST(MovingClocks, OfOneCameraThatIsLateByLittleIsNamed) {
  for (const unsigned seed : {1U, 2U}) {
    testing::MovingScene scene = testing::scene_of(testing::loops, seed, false);
    for (TargetObservation& observation : scene.observations)
      if (observation.head == 1) observation.t_capture_s -= 0.01;
    const Verdict verdict = verdict_of(scene, testing::unplaced(scene));
    const std::string said = verdict.sentence + "; " + verdict.to_add;
    EXPECT_NE(verdict.state, State::good) << seed;
    EXPECT_NE(said.find("head 2"), std::string::npos) << seed << ": " << said;
    EXPECT_NE(said.find("behind the others'"), std::string::npos) << seed << ": " << said;
    EXPECT_NE(said.find("--clocks"), std::string::npos) << seed << ": " << said;
  }
}

/// Of two cameras it was one that gives mirrored images.
TEST(MovingClocks, OfTwoCamerasTheDifferenceIsNamed) {
  testing::MovingScene scene = testing::scene_of(testing::loops, 4, false);
  std::erase_if(scene.observations, [](const TargetObservation& observation) { return observation.head == 2; });
  scene.truth.pop_back();
  for (TargetObservation& observation : scene.observations)
    if (observation.head == 1) observation.t_capture_s += 0.03;
  const Verdict verdict = verdict_of(scene, testing::unplaced(scene));
  const std::string said = verdict.sentence + "; " + verdict.to_add;
  EXPECT_NE(said.find("clocks"), std::string::npos) << said;
  EXPECT_NE(said.find("differ by"), std::string::npos) << said;
}

/// Rows that are exposed one after the other: 20 ms from the first to the last.
TEST(MovingClocks, ARollingShutterIsNamed) {
  testing::MovingScene scene = testing::scene_of(testing::loops, 2, false);
  for (TargetObservation& observation : scene.observations)
    if (observation.head == 2) observation.t_capture_s -= 0.02 * (observation.px.y() / 1080.0 - 0.5);
  const Verdict verdict = verdict_of(scene, testing::unplaced(scene));
  EXPECT_NE(verdict.to_add.find("head 3: the observations ask for a shutter that takes"), std::string::npos)
      << verdict.sentence << "; " << verdict.to_add;
}

/// It stayed good, the others taking over what it does.
TEST(MovingRejected, OfThreeCamerasOneThatIsTurnedByLittleIsNotSilent) {
  testing::MovingScene scene = testing::scene_of(testing::loops, 6, false);
  for (TargetObservation& observation : scene.observations)
    if (observation.head == 1 && observation.t_capture_s > 20.0) observation.px += Eigen::Vector2d(6.0, -4.0);
  const Verdict verdict = verdict_of(scene, testing::unplaced(scene));
  EXPECT_NE(verdict.state, State::good) << verdict.sentence;
  EXPECT_NE((verdict.sentence + verdict.to_add).find("moved"), std::string::npos) << verdict.to_add;
}

/// What it saw before, or after, was rejected or had no path: ● for the other part, degrees off.
TEST(MovingRejected, ACameraThatWasMovedAmidItsObservationsIsNamed) {
  for (const double from_s : {12.0, 28.0}) {
    testing::MovingScene scene = testing::scene_of(testing::loops, 5, false);
    for (TargetObservation& observation : scene.observations)
      if (observation.head == 2 && observation.t_capture_s > from_s) observation.px += Eigen::Vector2d(40.0, -25.0);
    const Verdict verdict = verdict_of(scene, testing::unplaced(scene));
    EXPECT_NE(verdict.state, State::good) << from_s << ": " << verdict.sentence;
    const std::string said = verdict.sentence + "; " + verdict.to_add;
    EXPECT_NE(said.find("moved"), std::string::npos) << from_s << ": " << said;
  }
  const testing::MovingScene scene = testing::scene_of(testing::loops, 5, false);
  EXPECT_EQ(verdict_of(scene, testing::unplaced(scene)).state, State::good);
}

}  // namespace
}  // namespace alidade
