#include "alidade/localize/map/moved_part.h"

#include <gtest/gtest.h>

#include "alidade/localize.h"
#include "alidade/testing/hover.h"
#include "alidade/testing/trials.h"

// Points of a target that are not where they are given.

namespace alidade {
namespace {

constexpr double sigma_given_m = 0.003, off_m = 0.01;
constexpr double chance = 28.0;

enum class Moved { none, left_half, every_other };

/// All points of a scene as a target, measured to 3 mm; some of them moved since.
std::vector<KnownPoint> given_points(std::span<const Eigen::Vector3d> points, Moved moved, Draws& draws) {
  const Eigen::Vector3d off = off_m * draws.normal3().normalized();
  std::vector<KnownPoint> given;
  for (std::size_t i = 0; i < points.size(); ++i) {
    const bool is_moved = moved == Moved::left_half ? points[i].x() < 0.0 : moved == Moved::every_other && i % 2 == 0;
    const Eigen::Vector3d was = is_moved ? Eigen::Vector3d(points[i] - off) : points[i];
    given.push_back({static_cast<long>(i) + 1, was + sigma_given_m * draws.normal3(), sigma_given_m});
  }
  return given;
}

std::vector<Eigen::Vector3d> scattered(Draws& draws) {
  std::vector<Eigen::Vector3d> points;
  for (int i = 0; i < 46; ++i)
    points.emplace_back(draws.uniform(-0.8, 0.8), draws.uniform(-0.6, 0.6), draws.uniform(-0.2, 0.9));
  return points;
}

/// Where the map has all of them right.
MovedPart of_right_map(Moved moved, std::uint64_t seed) {
  Draws draws(seed);
  const std::vector<Eigen::Vector3d> points = scattered(draws);
  std::vector<MapPoint> map;
  for (std::size_t i = 0; i < points.size(); ++i) map.push_back({static_cast<long>(i) + 1, points[i], {}, true, 9});
  return moved_part(map, given_points(points, moved, draws));
}

TEST(MovedPart, HalfOfATargetThatMovedIsFoundAndNoiseIsNot) {
  const int num = testing::trials(100);
  int num_named = 0, num_left = 0, num_other = 0;
  for (int seed = 1; seed <= num; ++seed) {
    const auto is_named = [&](Moved moved) {
      const MovedPart part = of_right_map(moved, static_cast<std::uint64_t>(seed));
      EXPECT_EQ(part.num_given, 46U);
      return part.chi2 > chance || part.spread > part.spread_limit;
    };
    num_named += is_named(Moved::none) ? 1 : 0;
    num_left += is_named(Moved::left_half) ? 1 : 0;
    num_other += is_named(Moved::every_other) ? 1 : 0;
  }
  EXPECT_LE(num_named, 1 + num / 100);
  EXPECT_GE(num_left, 9 * num / 10);
  EXPECT_GE(num_other, 9 * num / 10);
}

TEST(MovedPart, OfFewPointsNothingIsSaid) {
  Draws draws(1);
  std::vector<Eigen::Vector3d> points = scattered(draws);
  points.resize(11);
  std::vector<MapPoint> map;
  for (std::size_t i = 0; i < points.size(); ++i) map.push_back({static_cast<long>(i) + 1, points[i], {}, true, 9});
  EXPECT_EQ(moved_part(map, given_points(points, Moved::left_half, draws)).num_given, 0U);
}

/// ● with an error of 5σ: the path fits, between both halves.
TEST(MovedPart, APathBetweenBothHalvesIsNotGood) {
  for (const Moved moved : {Moved::none, Moved::left_half, Moved::every_other}) {
    testing::HoverRun run = testing::hovering({.num_frames = 90, .num_others = 40}, 3);
    Draws draws(8);
    run.camera.cov = Eigen::MatrixXd::Identity(10, 10) * 1e-10;
    LocalizeConfig config;
    config.sigma_times_s = 0.0;
    config.target.points = given_points(run.points, moved, draws);
    config.sigma_scale = 1e-4;
    const Localization result = localize(run.frames, run.camera, config);
    const bool is_said = result.verdict.sentence.find("target's") != std::string::npos;
    EXPECT_EQ(result.verdict.state == State::good, moved == Moved::none) << result.verdict.sentence;
    EXPECT_EQ(is_said, moved != Moved::none) << result.verdict.sentence;
  }
}

}  // namespace
}  // namespace alidade
