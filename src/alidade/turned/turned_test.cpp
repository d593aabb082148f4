#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdlib>
#include <random>

#include "alidade/geometry/so3.h"
#include "alidade/simulate/turned_scene.h"
#include "alidade/testing/trials.h"
#include "alidade/turned/turned.h"
#include "alidade/turned/turned_fit.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using Status = TurnedReport::Status;

/// Draws of a scene, observed: how far f, cx, cy are off, in their σ.
struct Drawn {
  int stands = 0, within_2 = 0, within_3 = 0, others_within_3 = 0;
  double rms = 0.0, worst = 0.0;  ///< z of fx; share of f.
};

Drawn draw(const TurnedScene& scene, int draws, const TurnedConfig& config, std::uint64_t first = 1) {
  Drawn drawn;
  for (int i = 0; i < draws; ++i) {
    const TurnedReport report =
        observe_turned(simulate_turned_photos(scene, first + static_cast<std::uint64_t>(i)), config);
    if (report.status != Status::ok) continue;
    ++drawn.stands;
    const Eigen::VectorXd sigma = report.cov.diagonal().cwiseSqrt();
    const double z = (report.camera[0] - scene.fx) / sigma[0];
    drawn.rms += z * z / draws;
    drawn.within_2 += std::abs(z) < 2.0 ? 1 : 0;
    drawn.within_3 += std::abs(z) < 3.0 ? 1 : 0;
    const bool centre = std::abs(report.camera[2] - scene.cx) < 3.5 * sigma[2] &&
                        std::abs(report.camera[3] - scene.cy) < 3.5 * sigma[3];
    drawn.others_within_3 += centre ? 1 : 0;
    drawn.worst = std::max(drawn.worst, std::abs(report.camera[0] / scene.fx - 1.0));
  }
  drawn.rms = std::sqrt(drawn.rms);
  return drawn;
}

TurnedConfig on_the_spot() {
  TurnedConfig config;
  config.sigma_parallax = 0.0;
  return config;
}

TurnedScene small_scene() {
  TurnedScene scene;
  scene.points_per_rad2 = 250.0;
  scene.num_photos = 7;
  return scene;
}

/// ALIDADE_TEST_TRIALS=8 draws as many.
const int few = testing::trials(2);

TEST(Turned, FindsTheCameraOfCleanMatchesWithinItsSigma) {
  const Drawn drawn = draw(small_scene(), 20, on_the_spot());
  EXPECT_EQ(drawn.stands, 20);
  EXPECT_GE(drawn.within_3, 20);
  EXPECT_GE(drawn.within_2, 18);
  EXPECT_GE(drawn.others_within_3, 19);
  EXPECT_LT(drawn.worst, 0.004);
}

TEST(Turned, WrongMatchesDoNotMoveTheAnswer) {
  for (const double share : {0.005, 0.05, 0.3, 0.6}) {
    TurnedScene scene = small_scene();
    scene.wrong_share = share;
    const Drawn drawn = draw(scene, few, on_the_spot(), 100);
    EXPECT_EQ(drawn.stands, few) << share;
    EXPECT_EQ(drawn.within_3, few) << share;
    EXPECT_LT(drawn.worst, 0.005) << share;
  }
}

TEST(Turned, NorDoWhatMovesAndWhatBends) {
  TurnedScene moving = small_scene();
  moving.moving_share = 0.25;
  const Drawn crowd = draw(moving, few, on_the_spot(), 200);
  EXPECT_EQ(crowd.within_3, few);
  TurnedScene wide = small_scene();
  wide.fx = wide.fy = 700.0;
  wide.k1 = -0.2;
  wide.k2 = 0.03;
  const Drawn bent = draw(wide, few, on_the_spot(), 300);
  EXPECT_EQ(bent.within_3, few);
  EXPECT_LT(bent.worst, 0.004);
}

TEST(Turned, TheRestOfTheLensIsEstimatedOrCounted) {
  for (const double p : {0.0002, 0.0005, 0.003}) {
    TurnedScene scene = small_scene();
    scene.p1 = p;
    scene.p2 = -p;
    const Drawn decentred = draw(scene, few, on_the_spot(), 500);
    EXPECT_EQ(decentred.within_3, few) << p;
    EXPECT_EQ(decentred.others_within_3, few) << p;
  }
  TurnedScene wide = small_scene();
  wide.k1 = -0.35;
  wide.k2 = 0.25;
  wide.k3 = -0.12;
  const Drawn bent = draw(wide, few, on_the_spot(), 600);
  EXPECT_EQ(bent.within_3, few);
  EXPECT_EQ(bent.others_within_3, few);
}

/// The same photos through an equidistant fisheye of `focal`.
void view_through_fisheye(const TurnedScene& scene, double focal, MatchedPhotos& photos) {
  std::mt19937 random(6);
  std::normal_distribution<double> noise(0.0, 0.2);
  const Eigen::Vector2d centre(scene.cx, scene.cy);
  for (auto& features : photos.features) {
    for (Eigen::Vector2d& px : features) {
      const Eigen::Vector2d x = (px - centre) / scene.fx;
      px = centre + focal * std::atan(x.norm()) * x.normalized() + Eigen::Vector2d(noise(random), noise(random));
    }
  }
}

TEST(Turned, AFisheyeThatTheModelDoesNotDescribeIsNamedAndCounted) {
  TurnedScene scene = small_scene();
  scene.fx = scene.fy = 480.0;
  scene.sigma_px = 0.0;
  constexpr double focal = 690.0;
  MatchedPhotos photos = simulate_turned_photos(scene, 610);
  view_through_fisheye(scene, focal, photos);
  const TurnedReport report = observe_turned(photos, on_the_spot());
  ASSERT_EQ(report.status, Status::ok);
  EXPECT_LT(std::abs(report.camera[0] - focal), 3.0 * std::sqrt(report.cov(0, 0)));
  EXPECT_LT(std::abs(report.camera[1] - focal), 3.0 * std::sqrt(report.cov(1, 1)));
  EXPECT_THAT(turned_verdict(report, photos, on_the_spot()).to_add, HasSubstr("fisheye"));
}

TEST(Turned, PixelsThatAreNotSquareAreNamed) {
  for (const bool fixes : {true, false}) {
    TurnedScene scene = small_scene();
    scene.fy = 1.01 * scene.fx;
    TurnedConfig config = on_the_spot();
    config.square_pixels = fixes;
    config.ordinary_aspect = config.ordinary_centre = false;
    const Drawn drawn = draw(scene, few, config, 700);
    EXPECT_EQ(drawn.within_3, few) << fixes;
    const MatchedPhotos photos = simulate_turned_photos(scene, 700);
    const Verdict verdict = turned_verdict(observe_turned(photos, config), photos, config);
    EXPECT_EQ(verdict.state, State::care) << fixes;
    EXPECT_THAT(verdict.to_add, HasSubstr(fixes ? "omit --square-pixels" : "not square")) << fixes;
  }
}

TEST(Turned, SqueezedImagesAreMeasuredAsTheyAreAndNamed) {
  for (const double aspect : {0.75, 4.0 / 3.0}) {
    TurnedScene scene = small_scene();
    scene.fy = aspect * scene.fx;
    scene.k1 = -0.05;
    const MatchedPhotos photos = simulate_turned_photos(scene, 710);
    TurnedConfig config = on_the_spot();
    const TurnedReport report = observe_turned(photos, config);
    ASSERT_EQ(report.status, Status::ok) << aspect;
    EXPECT_LT(std::abs(report.camera[0] - scene.fx), 3.5 * std::sqrt(report.cov(0, 0))) << aspect;
    EXPECT_LT(std::abs(report.camera[1] - scene.fy), 3.5 * std::sqrt(report.cov(1, 1))) << aspect;
    const Verdict verdict = turned_verdict(report, photos, config);
    EXPECT_EQ(verdict.state, State::care) << aspect;
    EXPECT_THAT(verdict.to_add, HasSubstr("not square")) << aspect;
    config.square_pixels = true;
    EXPECT_THAT(turned_verdict(observe_turned(photos, config), photos, config).to_add,
                HasSubstr("omit --square-pixels"))
        << aspect;
  }
}

/// A date in every photo, read as well as the scene and more often: `count` features at the same pixels.
void burn_in(int count, MatchedPhotos& photos) {
  std::mt19937 random(5);
  std::normal_distribution<double> noise(0.0, 0.02);
  std::vector<int> first;
  for (auto& features : photos.features) {
    first.push_back(static_cast<int>(features.size()));
    for (int i = 0; i < count; ++i)
      features.emplace_back(60.0 + 11.0 * (i % 30) + noise(random), 880.0 + 9.0 * (i / 30) + noise(random));
  }
  const int num_photos = static_cast<int>(photos.features.size());
  for (int a = 0; a < num_photos; ++a) {
    for (int b = a + 1; b < num_photos; ++b) {
      auto pair = std::ranges::find_if(photos.pairs,
                                       [&](const MatchedPair& each) { return each.photo_a == a && each.photo_b == b; });
      if (pair == photos.pairs.end()) pair = photos.pairs.insert(pair, {a, b, {}});
      for (int i = 0; i < count; ++i)
        pair->matches.push_back({first[static_cast<std::size_t>(a)] + i, first[static_cast<std::size_t>(b)] + i});
    }
  }
}

TEST(Turned, WhatIsBurnedIntoTheImageIsLeftOut) {
  const TurnedScene scene = small_scene();
  MatchedPhotos photos = simulate_turned_photos(scene, 720);
  burn_in(60, photos);
  const TurnedConfig config = on_the_spot();
  const TurnedReport report = observe_turned(photos, config);
  ASSERT_EQ(report.status, Status::ok);
  EXPECT_GT(report.matches.burned_in, 1200u);
  EXPECT_LT(std::abs(report.camera[0] - scene.fx), 3.5 * std::sqrt(report.cov(0, 0)));
  EXPECT_EQ(turned_verdict(report, photos, config).state, State::good);
  EXPECT_EQ(observe_turned(simulate_turned_photos(scene, 720), config).matches.burned_in, 0u);
}

TEST(Turned, ALeverThatIsSeenIsCountedThoughNoneIsGiven) {
  TurnedScene scene = small_scene();
  scene.num_photos = 5;
  scene.points_per_rad2 = 600.0;
  scene.lever_m = {0.0, 0.0, 0.2};
  const TurnedConfig config = on_the_spot();
  for (std::uint64_t seed = 2; seed < 4; ++seed) {
    const MatchedPhotos photos = simulate_turned_photos(scene, seed);
    const TurnedReport report = observe_turned(photos, config);
    ASSERT_EQ(report.status, Status::ok);
    EXPECT_LT(std::abs(report.camera[0] - scene.fx), 3.0 * std::sqrt(report.cov(0, 0)));
    EXPECT_THAT(turned_verdict(report, photos, config).to_add, HasSubstr("counted in σ"));
  }
}

TEST(Turned, ALeverOfMillimetresIsWithinSigmaAndOneOfDecimetresIsNamed) {
  TurnedScene scene = small_scene();
  scene.lever_m = {0.0, 0.0, 0.005};
  const Drawn hand = draw(scene, few, {}, 400);
  EXPECT_EQ(hand.within_3, few);
  EXPECT_EQ(hand.others_within_3, few);
  EXPECT_LT(hand.worst, 0.004);
  scene.points_per_rad2 = 600.0;
  scene.lever_m = {0.0, 0.0, 0.3};
  const TurnedConfig config;
  for (std::uint64_t seed = 1; seed <= 4; ++seed) {
    const MatchedPhotos photos = simulate_turned_photos(scene, seed);
    const TurnedReport report = observe_turned(photos, config);
    const Verdict verdict = turned_verdict(report, photos, config);
    EXPECT_NE(verdict.state, State::good);
    if (report.status != Status::ok) continue;
    EXPECT_LT(std::abs(report.camera[0] - scene.fx), 3.0 * std::sqrt(report.cov(0, 0)));
    EXPECT_GT(report.parallax.z, 6.0);
  }
}

/// Matches are sure across an edge and not along it: upright edges' noise lies along lines, as parallax does.
TEST(Turned, NoiseAlongEdgesIsNoParallax) {
  TurnedScene scene = small_scene();
  scene.sigma_px = 0.1;
  MatchedPhotos photos = simulate_turned_photos(scene, 730);
  std::mt19937 random(730);
  std::normal_distribution<double> along(0.0, 0.3);
  for (auto& features : photos.features) {
    for (Eigen::Vector2d& px : features) px.y() += along(random);
  }
  const TurnedReport report = observe_turned(photos, on_the_spot());
  ASSERT_EQ(report.status, Status::ok);
  EXPECT_LT(report.parallax.z, 6.0);
  EXPECT_EQ(turned_verdict(report, photos, on_the_spot()).state, State::good);
}

TEST(Turned, APhotoThatWasZoomedIsRefusedByName) {
  TurnedScene scene = small_scene();
  scene.zoom = {1.0, 1.0, 1.0, 1.15};
  const MatchedPhotos photos = simulate_turned_photos(scene, 5);
  const TurnedReport report = observe_turned(photos, {});
  ASSERT_EQ(report.status, Status::zoomed);
  const Verdict verdict = turned_verdict(report, photos, {});
  EXPECT_EQ(verdict.exit_code, ExitCode::undetermined);
  EXPECT_THAT(verdict.sentence, HasSubstr("photo004.jpg (1.15 times)"));
}

Verdict verdict_of(const MatchedPhotos& photos, const TurnedConfig& config = {}) {
  return turned_verdict(observe_turned(photos, config), photos, config);
}

TEST(Turned, DegenerateDataAreRefusedWithTheReason) {
  TurnedScene two = small_scene();
  two.num_photos = 2;
  EXPECT_THAT(verdict_of(simulate_turned_photos(two, 1)).sentence, HasSubstr("only two photos"));

  TurnedScene apart = small_scene();
  apart.pan_step_rad = 1.6;
  apart.num_photos = 3;
  MatchedPhotos none = simulate_turned_photos(apart, 1);
  none.pairs.clear();
  EXPECT_THAT(verdict_of(none).sentence, HasSubstr("no two of the 3 photos show the same"));

  MatchedPhotos same = simulate_turned_photos(two, 2);
  same.features[1] = same.features[0];
  for (FeatureMatch& match : same.pairs[0].matches) match.b = match.a;
  const Verdict one = verdict_of(same);
  EXPECT_EQ(one.exit_code, ExitCode::undetermined);
  EXPECT_THAT(one.sentence, HasSubstr("one image"));

  TurnedScene still = small_scene();
  still.pan_step_rad = still.tilt_rad = 0.0;
  still.shake_rad = 1e-3;
  const Verdict stands = verdict_of(simulate_turned_photos(still, 3));
  EXPECT_EQ(stands.exit_code, ExitCode::undetermined);
  EXPECT_THAT(stands.sentence, HasSubstr("does not turn"));
}

/// A camera that slides along a wall, or through a room, and does not rotate.
TEST(Turned, ACameraThatWalksIsRefused) {
  TurnedScene walk = small_scene();
  walk.pan_step_rad = walk.tilt_rad = 0.0;
  walk.shake_rad = 0.002;
  walk.sigma_step_m = 0.5;
  for (const double depth : {5.0, 20.0}) {
    walk.min_depth_m = 0.99 * depth;
    walk.max_depth_m = depth;
    const Verdict verdict = verdict_of(simulate_turned_photos(walk, 7));
    EXPECT_TRUE(verdict.exit_code == ExitCode::undetermined || verdict.state == State::bad) << verdict.sentence;
  }
}

TEST(Turned, AdviceNeverProposesWhatIsGiven) {
  TurnedScene scene = small_scene();
  scene.num_photos = 3;
  scene.pan_step_rad = 0.04;
  scene.tilt_rad = 0.01;
  scene.shake_rad = 0.002;
  scene.sigma_px = 1.5;
  TurnedConfig config;
  config.ordinary_aspect = config.ordinary_centre = false;
  const MatchedPhotos photos = simulate_turned_photos(scene, 3);
  const Verdict free = verdict_of(photos, config);
  EXPECT_EQ(free.exit_code, ExitCode::undetermined);
  config.square_pixels = config.fixed_centre = true;
  const Verdict held = verdict_of(photos, config);
  EXPECT_EQ(held.to_add.find("--square-pixels"), std::string::npos) << held.to_add;
  EXPECT_EQ(held.to_add.find("--fix-centre"), std::string::npos) << held.to_add;
}

TEST(Turned, ACentreThatIsFixedWronglyIsNamed) {
  TurnedScene scene = small_scene();
  scene.cx = 670.0;
  TurnedConfig config;
  config.square_pixels = config.fixed_centre = true;
  const MatchedPhotos photos = simulate_turned_photos(scene, 3);
  const TurnedReport report = observe_turned(photos, config);
  ASSERT_EQ(report.status, Status::ok);
  EXPECT_LT(std::abs(report.camera[0] - scene.fx), 3.0 * std::sqrt(report.cov(0, 0)));
  EXPECT_THAT(turned_verdict(report, photos, config).to_add, HasSubstr("omit --fix-centre"));
}

/// Without photo k the answer changes by what leaving it out really changes: one step is as good as a new solve.
TEST(Turned, TheInformationWithoutAPhotoIsThatOfTheOthers) {
  const MatchedPhotos photos = simulate_turned_photos(small_scene(), 4);
  const auto links = find_links(photos);
  const PhotoTree tree = largest_tree(photos.names.size(), links);
  const auto starts = focal_starts(photos, links);
  const TurnedFit fit = fit_turned(photos, links, tree, starts.front(), on_the_spot(), false, {});
  constexpr int without = 3;
  const TurnedNormal normal = turned_normal(fit.bundle, fit.prior, fit.solve, without);
  Eigen::MatrixXd information = normal.information;
  information.diagonal().array() += 1e-6;
  const Eigen::VectorXd step = -information.ldlt().solve(normal.gradient);
  TurnedBundle others = fit.bundle;
  std::erase_if(others.observations, [](const TurnedDetection& observation) { return observation.photo == without; });
  (void)solve_turned(others, fit.prior, fit.solve);
  const double f = fit.bundle.camera[0];
  EXPECT_NEAR(f + step[0], others.camera[0], 0.1 * std::abs(others.camera[0] - f) + 1e-6 * f);
}

}  // namespace
}  // namespace alidade
