#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <string>

#include "alidade/rig/rig.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

// Tables of which some rows are not as they were taken.

namespace alidade {
namespace {

using Change = std::function<void(std::vector<HeadView>&)>;

Verdict verdict_on(std::uint64_t seed, const Change& change) {
  RigSceneConfig config;
  config.num_boards = 6;
  const RigScene scene = draw_rig_scene(config, seed);
  std::vector<HeadView> views = simulate_head_views(scene, {}, seed).views;
  change(views);
  const std::vector<Eigen::Vector3d> points = points_in_board(scene.board);
  return rig_verdict(calibrate_rig(views, points, testing::cameras_of(scene.rig), {}), {});
}

void exchange_head(HeadView& view) { view.head = 3 - view.head; }

void count_backwards(HeadView& view) {
  for (Corner& corner : view.seen.corners) corner.index = 53 - corner.index;
}

TEST(MisreadRows, AnglesOfTheViewBeforeInAPartOfTheTableAreNamed) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    std::string first;
    const Verdict verdict = verdict_on(seed, [&first](std::vector<HeadView>& views) {
      const std::vector<HeadView> own = views;
      for (std::size_t v = views.size() / 2; v < views.size(); ++v) views[v].pan_tilt_rad = own[v - 1].pan_tilt_rad;
      first = views[views.size() / 2].seen.photo;
    });
    EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << seed;
    EXPECT_NE(verdict.sentence.find("the angles from " + first + " to "), std::string::npos) << verdict.sentence;
    EXPECT_NE(verdict.sentence.find("are those of the view before"), std::string::npos) << verdict.sentence;
  }
}

TEST(MisreadRows, HeadsExchangedInAPartOfTheTableAreNamed) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Verdict verdict = verdict_on(seed, [](std::vector<HeadView>& views) {
      for (std::size_t v = 0; v < views.size() / 2; ++v) exchange_head(views[v]);
    });
    EXPECT_EQ(verdict.exit_code, ExitCode::undetermined) << seed;
    EXPECT_NE(verdict.sentence.find("heads swapped from "), std::string::npos) << verdict.sentence;
  }
}

/// The verdict names the rows, and how they would fit.
void expect_rows_named(const std::string& words, const Change& change) {
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    const Verdict verdict = verdict_on(seed, change);
    EXPECT_EQ(verdict.state, State::care) << seed << ": " << verdict.sentence;
    EXPECT_NE(verdict.to_add.find(words), std::string::npos) << seed << ": " << verdict.to_add;
    EXPECT_NE(verdict.to_add.find("correct these rows"), std::string::npos) << verdict.to_add;
  }
}

TEST(MisreadRows, SingleViewsOfTheOtherHeadAreNamed) {
  expect_rows_named("rejected: view 5 (fits head ", [](std::vector<HeadView>& views) { exchange_head(views[5]); });
}

TEST(MisreadRows, ViewsAreNamedAsTheTableHasThem) {
  expect_rows_named("rejected: view 150 (fits head ", [](std::vector<HeadView>& views) {
    for (std::size_t v = 0; v < views.size(); ++v) views[v].seen.photo = "view " + std::to_string(100 + 10 * v);
    exchange_head(views[5]);
  });
  expect_rows_named("rejected: left.png (fits head ", [](std::vector<HeadView>& views) {
    views[5].seen.photo = "left.png";
    exchange_head(views[5]);
  });
}

/// Blur spreads corners, and leaves the board where it is.
TEST(MisreadRows, OfABoardWhereItShouldBeThePixelsAreNamed) {
  RigSceneConfig config;
  config.num_boards = 6;
  const RigScene scene = draw_rig_scene(config, 1);
  std::vector<HeadView> views = simulate_head_views(scene, {}, 1).views;
  for (Corner& corner : views[5].seen.corners) corner.px.x() += corner.index % 2 == 0 ? 1.0 : -1.0;
  const RigReport report = calibrate_rig(views, points_in_board(scene.board), testing::cameras_of(scene.rig), {});
  EXPECT_FALSE(report.views[5].used);
  EXPECT_TRUE(report.views[5].reason.starts_with("outlier: its corners are 1")) << report.views[5].reason;
  EXPECT_EQ(report.views[5].reason.find("0.0° and 0 mm"), std::string::npos) << report.views[5].reason;
}

TEST(MisreadRows, ViewsOfAnotherBoardAreNamed) {
  expect_rows_named("(fits board 2)", [](std::vector<HeadView>& views) {
    for (HeadView& view : views)
      if (view.head == 2 && view.board == 2) view.board = 3;
  });
}

/// Of one board by one head: it did not move.
TEST(MisreadRows, CornersOfABoardFromTheOtherEndAreNamed) {
  expect_rows_named("(corners numbered from the other end of the board)", [](std::vector<HeadView>& views) {
    for (HeadView& view : views)
      if (view.head == 2 && view.board == 2) count_backwards(view);
  });
}

}  // namespace
}  // namespace alidade
