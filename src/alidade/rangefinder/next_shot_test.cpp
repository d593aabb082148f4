#include "alidade/rangefinder/next_shot.h"

#include <gtest/gtest.h>

#include "alidade/rangefinder/checks/repeated_shots.h"
#include "alidade/rangefinder/shot_plan.h"
#include "alidade/testing/rangefinder_sample.h"

namespace alidade {
namespace {

using namespace testing;

/// What two drawn shots leave known; what planned and drawn shots are added to.
struct Begun {
  RangefinderSceneConfig config = *rangefinder_scenario("reference");
  RangefinderSample sample;
  BeamNow now;
};

Begun begin(std::uint64_t seed, int num_shots) {
  Begun begun;
  begun.config.num_shots = num_shots;
  begun.sample = draw_rangefinder_sample(begun.config, {}, seed);
  const RangefinderReport report = solve_sample(begun.sample, given_config(RangefinderMethod::joint));
  begun.now = {report.beam, report.camera, begun.sample.points};
  return begun;
}

/// √ of the mean variance of measured points at 0, 0.5, 1.4 and 4 m.
double point_sigma_m(const Beam& beam) {
  double sum = 0.0;
  for (const double range_m : {0.0, 0.5, std::sqrt(2.0), 4.0}) {
    const auto J = J_point_beam(beam, range_m);
    sum += 0.25 * (J * beam.cov * J.transpose()).trace();
  }
  return std::sqrt(sum);
}

/// The planned shots really taken: simulated at the planned poses, after those from before.
RangefinderSample with_taken(const RangefinderSample& before, const std::vector<NextShot>& plan, const ShotNoise& noise,
                             std::uint64_t seed) {
  RangefinderSample taken = before;
  RangefinderScene more = before.scene;
  more.range_m.clear();
  more.cam_from_board.clear();
  for (const NextShot& shot : plan) {
    // The board stands where the true beam meets it, not where the estimate says.
    const Plane plane = plane_of(shot.cam_from_board);
    more.cam_from_board.push_back(shot.cam_from_board);
    more.range_m.push_back(-(plane.d_m + plane.normal_in_cam.dot(more.beam.origin_in_cam)) /
                           plane.normal_in_cam.dot(more.beam.direction_in_cam));
  }
  for (const Shot& shot : simulate_shots(more, noise, seed).shots) taken.simulated.shots.push_back(shot);
  return taken;
}

SolvedRangefinder solved(const RangefinderSample& sample, const RangefinderConfig& config) {
  return solve_rangefinder(sample.simulated.shots, sample.points, sample.camera, config);
}

/// Planned σ over those that rangefinder() states with the planned shots, of the origin and of the direction: medians
/// of nine logs, for what a log shows by chance is counted too.
Eigen::Vector2d planned_over_stated(const RangefinderConfig& config, int num_shots, const ShotNoise& noise) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.num_shots = num_shots;
  std::vector<double> origin, direction;
  for (std::uint64_t seed = 1; seed <= 9; ++seed) {
    const RangefinderSample before = draw_rangefinder_sample(scene, noise, seed);
    const SolvedRangefinder now = solved(before, config);
    const auto plan = plan_next_shots(beam_now(now.report, now.config), {}, 3);
    if (plan.size() != 3) return Eigen::Vector2d::Zero();
    const RangefinderReport after = solved(with_taken(before, plan, noise, seed + 77), config).report;
    origin.push_back(plan.back().sigma_origin_m / after.bound.sigma_origin_m);
    direction.push_back(plan.back().sigma_direction_rad / after.bound.sigma_direction_rad);
  }
  return {quantile_of(origin, 0.5), quantile_of(direction, 0.5)};
}

RangefinderConfig given_board() {
  RangefinderConfig config = given_config(RangefinderMethod::joint);
  config.board = rangefinder_scenario("reference")->board;
  config.rates_next_shots = false;
  return config;
}

void expect_ones(const Eigen::Vector2d& ratio) {
  EXPECT_NEAR(ratio[0], 1.0, 0.1);
  EXPECT_NEAR(ratio[1], 1.0, 0.1);
}

// The camera file is a pinhole's, without a word about distortion: eight shots do not ask for it, eleven do.
TEST(NextShot, IsWorthWhatRangefinderStatesWithIt) { expect_ones(planned_over_stated(given_board(), 8, {})); }

TEST(NextShot, CountsASheetThatIsTold) {
  RangefinderConfig config = given_board();
  for (const double sigma_m : {0.0, 0.01}) {
    config.sigma_flat_m = sigma_m;
    expect_ones(planned_over_stated(config, 8, {}));
  }
}

TEST(NextShot, LeavesWhatAFixedLensAddsToTheBeam) {
  RangefinderConfig config = given_board();
  config.refine = Refine::beam;
  expect_ones(planned_over_stated(config, 8, {}));
}

TEST(NextShot, HasNoSpotWhereNoneWasSeen) { expect_ones(planned_over_stated(given_board(), 12, {.with_spot = false})); }

TEST(NextShot, HasNoBoardWhereNoneWasSeen) {
  expect_ones(planned_over_stated(given_board(), 18, {.with_board = false}));
}

/// The shots as they would be measured, without errors.
std::vector<Shot> seen(const BeamNow& now, const std::vector<NextShot>& plan) {
  std::vector<Shot> shots;
  for (const NextShot& next : plan) {
    Shot& shot = shots.emplace_back();
    shot.range_m = next.distance_m;
    shot.board.emplace();
    for (std::size_t i = 0; i < now.points_in_board.size(); ++i)
      shot.board->corners.push_back(
          {static_cast<int>(i), *project(now.camera, next.cam_from_board * now.points_in_board[i])});
  }
  return shots;
}

TEST(NextShot, RepeatsNone) {
  const BeamNow now = begin(1, 8).now;
  const auto few = plan_next_shots(now, {0.5, 0.6, 0.0}, 20);
  EXPECT_EQ(few.size(), 8u);  // one a distance
  for (const ShotLimits& limits : {ShotLimits{0.5, 0.6, 0.0}, {2.9, 3.0, 0.08}, {0.5, 4.0, 0.78}}) {
    const auto shots = seen(now, plan_next_shots(now, limits, 20));
    for (std::size_t i = 0; i < shots.size(); ++i)
      for (std::size_t j = 0; j < i; ++j) EXPECT_FALSE(at_one_placement(shots[j], shots[i])) << i << ' ' << j;
  }
}

TEST(NextShot, FiveGuidedShotsAreAsGoodAsFifteenRandomOnes) {
  double guided2 = 0.0, random2 = 0.0, truth2 = 0.0;
  for (std::uint64_t seed = 1; seed <= 20; ++seed) {
    Begun begun = begin(seed, 2);
    const auto plan = plan_next_shots(begun.now, {}, 5);
    ASSERT_EQ(plan.size(), 5u);
    const RangefinderSample taken = with_taken(begun.sample, plan, {}, seed + 77);
    const RangefinderReport guided = solve_sample(taken, given_config(RangefinderMethod::joint));
    const RangefinderReport random = solve_sample(begin(seed + 500, 17).sample, given_config(RangefinderMethod::joint));
    guided2 += std::pow(point_sigma_m(guided.beam), 2);
    random2 += std::pow(point_sigma_m(random.beam), 2);
    truth2 += std::pow(origin_error_m(guided, taken), 2);
    // What was promised came: of shots that err as the model says.
    const double sigma_m = std::sqrt(guided.bound.cov.topLeftCorner<3, 3>().trace());
    EXPECT_NEAR(plan.back().sigma_origin_m / sigma_m, 1.0, 0.3);
  }
  EXPECT_LE(std::sqrt(guided2 / random2), 1.05);
  EXPECT_LT(std::sqrt(truth2 / 20), 0.004);
}

TEST(NextShot, EachLowersWhatIsUnknown) {
  const Begun begun = begin(3, 3);
  double before_m = begun.now.beam.cov.topLeftCorner<3, 3>().trace();
  before_m = std::sqrt(before_m);
  for (const NextShot& shot : plan_next_shots(begun.now, {}, 4)) {
    EXPECT_LT(shot.sigma_origin_m, before_m);
    before_m = shot.sigma_origin_m;
  }
}

TEST(NextShot, AsksForWhatADegenerateLogLacks) {
  RangefinderSceneConfig config = *rangefinder_scenario("near_frontal");
  const auto sample = draw_rangefinder_sample(config, {}, 4);
  const RangefinderReport report = solve_sample(sample, given_config(RangefinderMethod::plane));
  BeamNow now{report.beam, report.camera, sample.points};
  now.method = RangefinderMethod::plane;
  const auto tilted = plan_next_shots(now, {}, 1);
  ASSERT_EQ(tilted.size(), 1u);
  EXPECT_GT(tilted[0].tilt_rad, 0.4);
  EXPECT_FALSE(next_shot_gains(now, {}).empty());
}

TEST(NextShot, HasNoneWithoutABoard) { EXPECT_TRUE(plan_next_shots({}, {}, 3).empty()); }

}  // namespace
}  // namespace alidade
