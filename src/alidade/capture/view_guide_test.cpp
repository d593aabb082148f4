// Guided views of a pan-tilt head against those of somebody who looks anywhere.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <random>

#include "alidade/capture.h"
#include "alidade/geometry/degree.h"
#include "alidade/simulate/rig.h"
#include "alidade/testing/rig_sample.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;

constexpr double sigma_corner_px = 0.2, sigma_reading_rad = 0.02 * degree;

/// A head of that scene that looks at a board where it stands: what its camera sees, and what its encoders read.
class Looking {
 public:
  Looking(const RigScene& scene, std::uint64_t seed) : scene_(scene), draw_(seed) {}

  std::optional<HeadView> at(int head, int board, const Rigid3& world_from_board, const Eigen::Vector2d& asked_rad) {
    const RigHead& rig_head = scene_.rig.heads[static_cast<std::size_t>(head - 1)];
    HeadView view{.board = board, .head = head};
    view.seen.photo = "view " + std::to_string(++num_);
    // A head comes near to where it is sent; its encoders err beside.
    const Eigen::Vector2d stands_rad = asked_rad + 0.3 * degree * normal2();
    view.pan_tilt_rad = stands_rad + sigma_reading_rad * normal2();
    const auto points = points_in_board(scene_.board);
    for (std::size_t i = 0; i < points.size(); ++i) {
      const auto seen = project(rig_head, stands_rad, world_from_board * points[i]);
      if (!seen || seen->px.minCoeff() < 1.0 || seen->px.x() > rig_head.camera.width_px - 2 ||
          seen->px.y() > rig_head.camera.height_px - 2)
        continue;
      view.seen.corners.push_back({.index = static_cast<int>(i), .px = seen->px + sigma_corner_px * normal2()});
    }
    if (2 * view.seen.corners.size() < points.size()) return std::nullopt;
    return view;
  }

 private:
  Eigen::Vector2d normal2() {
    const double x = normal_(draw_);
    return {x, normal_(draw_)};
  }
  const RigScene& scene_;
  std::mt19937_64 draw_;
  std::normal_distribution<double> normal_;
  int num_ = 0;
};

/// What the guide says of one head after so many more views: as it asks for them, or as the scene drew them.
class Comparison {
 public:
  Comparison(std::size_t num_heads, std::uint64_t seed)
      : scene_(draw_rig_scene({.num_boards = 12}, seed)), looking_(scene_, seed), num_heads_(num_heads) {
    for (const HeadView& view : simulate_head_views(scene_, {sigma_corner_px, sigma_reading_rad}, seed).views)
      if (view.head <= static_cast<int>(num_heads)) drawn_.push_back(view);
    config_.board = scene_.board;
    config_.sigma_px = sigma_corner_px;
    config_.sigma_encoder_rad = sigma_reading_rad;
  }

  ViewGuide begun(std::size_t num_views) {
    std::map<int, Camera> cameras = testing::cameras_of(scene_.rig);
    if (num_heads_ == 1) cameras.erase(2);
    ViewGuide guide(cameras, config_);
    for (std::size_t i = 0; i < num_views; ++i) (void)guide.push(drawn_[i]);
    return guide;
  }

  /// As many as were wanted; the board is where its rig has it, which is not quite where the guide believes.
  void follow(ViewGuide& guide, int num_views) {
    std::map<int, Rigid3> posed;
    for (std::size_t b = 0; b < scene_.world_from_board.size(); ++b)
      posed[static_cast<int>(b)] = scene_.world_from_board[b];
    for (int i = 0; i < num_views; ++i) {
      ASSERT_TRUE(guide.state().next) << guide.state().verdict.sentence;
      const NextView next = *guide.state().next;
      const RigHead& rig_head = scene_.rig.heads[static_cast<std::size_t>(next.head - 1)];
      if (next.is_new_position) {  // a number of its own, held as asked before the camera that is there
        new_positions_ += 1;
        posed[next.board] = world_from_cam(rig_head.head, next.pan_tilt_rad) * next.cam_from_board;
      }
      const auto view = looking_.at(next.head, next.board, posed.at(next.board), next.pan_tilt_rad);
      ASSERT_TRUE(view) << guide.state().words;
      (void)guide.push(*view);
    }
  }

  const std::vector<HeadView>& drawn() const { return drawn_; }
  int new_positions() const { return new_positions_; }

 private:
  RigScene scene_;
  Looking looking_;
  std::size_t num_heads_;
  RigConfig config_;
  std::vector<HeadView> drawn_;
  int new_positions_ = 0;
};

TEST(ViewGuide, GuidedViewsTellMoreThanAsManyOthers) {
  constexpr std::size_t num_first = 8, num_more = 6;
  for (std::uint64_t seed = 1; seed <= 3; ++seed) {
    Comparison one(1, seed);
    ASSERT_GE(one.drawn().size(), num_first + num_more);
    ViewGuide guided = one.begun(num_first), others = one.begun(num_first + num_more);
    ASSERT_TRUE(guided.state().has_rig) << guided.state().verdict.sentence;
    one.follow(guided, num_more);
    std::printf("seed %d: guided %.4f deg %.2f mm, as drawn %.4f deg %.2f mm\n", static_cast<int>(seed),
                guided.state().sigma.angle_rad / degree, 1e3 * guided.state().sigma.length_m,
                others.state().sigma.angle_rad / degree, 1e3 * others.state().sigma.length_m);
    EXPECT_LT(guided.state().sigma.angle_rad, others.state().sigma.angle_rad) << seed;
    EXPECT_LT(guided.state().sigma.length_m, others.state().sigma.length_m) << seed;
    EXPECT_TRUE(guided.state().verdict.ok()) << guided.state().verdict.sentence;
  }
}

TEST(ViewGuide, TellsWhereASecondHeadIsToLook) {
  Comparison two(2, 4);
  ViewGuide guide = two.begun(two.drawn().size() / 2);
  ASSERT_TRUE(guide.state().has_rig) << guide.state().verdict.sentence;
  const RigSigma before = guide.state().sigma;
  two.follow(guide, 4);
  EXPECT_LT(guide.state().sigma.angle_rad * guide.state().sigma.length_m, before.angle_rad * before.length_m);
  const int num_views = guide.state().views;
  guide.undo();
  EXPECT_EQ(guide.state().views, num_views - 1);
}

TEST(ViewGuide, SaysWhereToBeginAndRefusesWhatCannotBe) {
  const RigScene scene = draw_rig_scene({}, 2);
  std::map<int, Camera> cameras = testing::cameras_of(scene.rig);
  RigConfig config;
  EXPECT_THROW(ViewGuide(cameras, config), ConfigError);  // no board
  config.board = scene.board;
  EXPECT_THROW(ViewGuide({}, config), ConfigError);
  EXPECT_THROW(ViewGuide(cameras, config, {.min_pan_deg = 10.0, .max_pan_deg = -10.0}), ConfigError);
  ViewGuide guide(cameras, config);
  EXPECT_THAT(guide.state().words, HasSubstr("position 1"));
  HeadView view{.head = 7};
  EXPECT_THROW((void)guide.push(view), ConfigError);
  view.head = 1;
  view.pan_tilt_rad = {std::nan(""), 0.0};
  EXPECT_THROW((void)guide.push(view), ConfigError);
  EXPECT_EQ(guide.state().views, 0);
}

}  // namespace
}  // namespace alidade
