#include "alidade/calibrate/checks/better_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "alidade/calibrate/checks/judge.h"
#include "alidade/simulate/boards/board_photos.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

const Board wide_board{.cols = 8, .rows = 6, .square_m = 0.03};
constexpr ImageSize wide_size{1280, 960};

/// Corners, σ 0.1 px, of a lens that is nearly equidistant, as action cameras have them.
std::vector<BoardView> wide_views(double field_of_view_deg, int num_photos, std::uint64_t seed) {
  const double f = 0.5 * wide_size.width_px / (0.5 * field_of_view_deg * std::numbers::pi / 180.0);
  const Params<KannalaBrandt> lens{f, 1.002 * f, 644.0, 473.0, 0.0, 0.02, -0.005, 0.001, 0.0};
  const Camera camera{wide_size.width_px, wide_size.height_px, Calibrated<KannalaBrandt>{lens}, {}, 0.0, ""};
  BoardSceneConfig config;
  config.num_photos = num_photos;
  return simulate_views(draw_board_scene(camera, wide_board, config, seed), 0.1, seed);
}

Calibration judged(std::vector<BoardView> views, const CalibrateConfig& config) {
  PhotoCalibration photos;
  photos.reasons.resize(views.size());
  photos.size = wide_size;
  photos.report = calibrate(wide_board, views, wide_size, config);
  photos.views = std::move(views);
  return judge_calibration(wide_board, std::move(photos), config);
}

TEST(BetterModel, ABrownLensOnAWideCameraEndsInAnAnswer) {
  // Its radial map folds inside the image: a step that puts one corner behind the fold must not stop the solve.
  for (const double field_of_view_deg : {120.0, 135.0, 150.0}) {
    for (const std::uint64_t seed : {1u, 2u, 3u}) {
      for (const int num_photos : {8, 20}) {
        const auto views = wide_views(field_of_view_deg, num_photos, seed);
        for (const std::vector<std::string>& fixed : {std::vector<std::string>{"skew"}, {}, {"skew", "k3"}}) {
          const CalibrateReport report = calibrate(wide_board, views, wide_size, {.fixed = fixed});
          EXPECT_EQ(report.status, CalibrateReport::Status::converged)
              << field_of_view_deg << "° seed " << seed << ", " << num_photos << " photos: " << report.reason;
          EXPECT_TRUE(std::isfinite(report.rms_px));
        }
      }
    }
  }
}

TEST(BetterModel, WhereALensCannotFitTheOneThatDoesIsNamed) {
  CalibrateConfig pinhole{.model = "pinhole", .board_shape = BoardShape::free};
  const Calibration refused = judged(wide_views(150.0, 8, 1), pinhole);
  ASSERT_NE(refused.status, CalibrateReport::Status::converged);
  // σ 0.1 px a coordinate is 0.141 px a point.
  EXPECT_THAT(refused.verdict.to_add, StartsWith("use --model kannala_brandt: it fits these corners with RMS 0.14"));
  EXPECT_THAT(refused.verdict.sentence, Not(HasSubstr("settle")));
}

TEST(BetterModel, NoLensIsProposedWhereTheCornersAreWrong) {
  auto views = wide_views(100.0, 8, 1);
  for (BoardView& view : views) std::reverse(view.corners.begin() + 3, view.corners.end() - 5);
  for (BoardView& view : views) {
    for (std::size_t i = 0; i < view.corners.size(); ++i) view.corners[i].index = static_cast<int>(i);
  }
  CalibrateReport report = calibrate(wide_board, views, wide_size, {});
  report.to_add = "as it was";
  advise_fitting_model(wide_board, views, wide_size, {}, report);
  EXPECT_EQ(report.to_add, "as it was");
}

/// A study in which one model of the ladder gains.
CalibrationStudy gains(const std::string& name, bool is_richer = true) {
  CalibrationStudy study;
  study.models = {{.name = "k1", .heldout_rms_px = 0.2, .sigma_px = 0.01, .gain_px = -0.1, .is_richer = false},
                  {.name = name, .heldout_rms_px = 0.1, .sigma_px = 0.01, .gain_px = 0.1, .is_richer = is_richer}};
  return study;
}

TEST(BetterModel, WhatToTypeIsSaidAndNeverWhatIsTypedAlready) {
  EXPECT_EQ(better_model_advice(gains("kannala_brandt"), {}), "use --model kannala_brandt");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3 skew"), {}), "use --free skew");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3 skew"), {.fixed = {"skew", "cx"}}), "use --free skew");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3 skew"), {.fixed = {"skew", "k3"}}),
            "use --free skew, and no --fix");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3"), {.fixed = {"skew", "k3"}}), "omit --fix");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3"), {.model = "pinhole"}), "use --model brown");
  EXPECT_EQ(better_model_advice(gains("k1 k2"), {.model = "pinhole"}), "use --model brown --fix p1,p2,k3");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2"), {.fixed = {"skew", "k2", "p1", "p2", "k3"}}), "use --fix k3");
  EXPECT_EQ(better_model_advice(gains("k1 k2 p1 p2 k3", false), {.model = "kannala_brandt"}), "") << "no richer one";
  EXPECT_EQ(better_model_advice({}, {}), "");
}

/// Of those that lie within so much of the image's width and height, about its centre.
std::vector<BoardView> in_the_centre(const std::vector<BoardView>& views, double share, std::size_t num) {
  const Eigen::Array2d half = 0.5 * Eigen::Array2d(wide_size.width_px, wide_size.height_px);
  std::vector<BoardView> inside;
  for (const BoardView& view : views) {
    const bool is_inside = std::ranges::all_of(
        view.corners, [&](const Corner& corner) { return ((corner.px.array() - half).abs() < share * half).all(); });
    if (is_inside && inside.size() < num) inside.push_back(view);
  }
  return inside;
}

// Such were ● with the image's corner 7.5σ off: what Brown's polynomial does there no board had said.
TEST(BetterModel, ARivalIsNamedWhereNoBoardRulesItOut) {
  int named = 0;
  for (const std::uint64_t seed : {3u, 4u, 5u, 6u}) {
    const std::vector<BoardView> views = in_the_centre(wide_views(100.0, 300, seed), 0.7, 24);
    ASSERT_EQ(views.size(), 24u);
    const Calibration result = judged(views, {});
    const auto rival = rival_model(wide_board, result.board_views, result.config, result);
    if (!rival) continue;
    ++named;
    EXPECT_EQ(rival->model, "kannala_brandt");
    EXPECT_GT(rival->sigmas, 3.0);
    EXPECT_NE(result.verdict.state, State::good);
    const auto check = std::ranges::find(result.verdict.checks, "one model", &Check::name);
    ASSERT_NE(check, result.verdict.checks.end());
    EXPECT_THAT(check->text, HasSubstr("kannala_brandt fits these photos as well, and differs by"));
  }
  EXPECT_GE(named, 3) << "of 4";
}

TEST(BetterModel, WhereBoardsAreAllOverTheImageNoneIs) {
  for (const std::uint64_t seed : {1u, 2u, 3u, 4u}) {
    for (const char* model : {"brown", "kannala_brandt"}) {
      const Calibration result = judged(wide_views(110.0, 24, seed), {.model = model});
      EXPECT_FALSE(rival_model(wide_board, result.board_views, result.config, result)) << seed << " " << model;
    }
  }
}

TEST(BetterModel, TheRichestInUseIsNotProposedAgain) {
  const Calibration calibration = judged(wide_views(150.0, 12, 4), {.model = "kannala_brandt"});
  ASSERT_EQ(calibration.status, CalibrateReport::Status::converged);
  EXPECT_THAT(calibration.verdict.to_add, Not(HasSubstr("--model")));
}

}  // namespace
}  // namespace alidade
