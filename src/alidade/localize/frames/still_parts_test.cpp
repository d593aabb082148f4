#include "alidade/localize/frames/still_parts.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/localize.h"
#include "alidade/patches/reference_patch.h"
#include "alidade/testing/room_film.h"

namespace alidade {
namespace {

using testing::RoomFilm;
using testing::RoomScene;

RoomFilm marked_film(int num_frames) {
  RoomScene scene;
  scene.camera = testing::room_camera();
  scene.num_frames = num_frames;
  scene.amplitude = 1.4;
  return testing::room_film(scene);
}

/// Digits that change, and a frame around the image that does not.
void burn_in(cv::Mat& image, std::size_t i) {
  cv::putText(image, cv::format("REC 12:34:%02d.%02d", static_cast<int>(i / 30), static_cast<int>(i % 30) * 3),
              {20, 225}, cv::FONT_HERSHEY_SIMPLEX, 0.7, cv::Scalar(255), 2);
  cv::putText(image, "CAM 1 DEPTH 12.4m", {60, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.7, cv::Scalar(255), 2);
}

Localization localized_marked(const RoomFilm& film, bool masks_still) {
  LocalizeConfig config;
  config.filter.sigma_a_m_s2 = 4.0;
  config.filter.sigma_alpha_rad_s2 = 6.0;
  config.target = rectangle_target(0.210, 0.1485);
  config.masks_still = masks_still;
  return testing::localized(film, config);
}

TEST(StillParts, WhatIsBurntInIsMaskedAndTheSceneIsNot) {
  RoomFilm with = marked_film(60);
  StillParts of_scene, of_both;
  for (std::size_t i = 0; i < with.images.size(); ++i) {
    (void)of_scene.add(smoothed_for_search(with.images[i]));
    burn_in(with.images[i], i);
    (void)of_both.add(smoothed_for_search(with.images[i]));
  }
  EXPECT_LT(of_scene.still_share(), 0.001);
  const cv::Mat shown = of_both.shown(PatchView::half_px + 2);
  ASSERT_EQ(shown.size(), with.images.front().size());
  cv::Mat text(shown.size(), CV_8U, cv::Scalar(0));
  cv::putText(text, "CAM 1 DEPTH 12.4m", {60, 24}, cv::FONT_HERSHEY_SIMPLEX, 0.7, cv::Scalar(255), 2);
  const double num_text = cv::countNonZero(text);
  EXPECT_LT(cv::countNonZero(text & shown), 0.05 * num_text);
  const cv::Mat centre = shown(cv::Rect(0, 60, 320, 120));
  EXPECT_GT(cv::countNonZero(centre), 0.98 * static_cast<double>(centre.total()));
}

/// While the camera stands everything stands: nothing is masked.
TEST(StillParts, ACameraThatStandsMasksNothing) {
  RoomFilm still = marked_film(1);
  StillParts parts;
  for (std::uint64_t i = 0; i < 60; ++i)
    (void)parts.add(smoothed_for_search(testing::render_room(still.scene, still.truth[0].world_from_cam, i + 1)));
  EXPECT_EQ(parts.still_share(), 0.0);
}

TEST(StillParts, APathIsAsGoodWithAClockBurntIn) {
  RoomFilm with = marked_film(120);
  const Localization clean = localized_marked(with, false), masked_clean = localized_marked(with, true);
  EXPECT_LT(masked_clean.still_share, 0.001);
  EXPECT_LT(masked_clean.error.ate_m, 1.3 * clean.error.ate_m);  // a feature or two are chosen elsewhere
  for (std::size_t i = 0; i < with.images.size(); ++i) burn_in(with.images[i], i);
  const Localization masked = localized_marked(with, true);
  EXPECT_EQ(masked.num_lost, 0u);
  EXPECT_GT(masked.still_share, 0.005);
  EXPECT_LT(masked.error.ate_m, 1.5 * clean.error.ate_m) << clean.error.ate_m;  // part of the image is covered
  EXPECT_NE(masked.verdict.checks.end(), std::ranges::find(masked.verdict.checks, "still parts", &Check::name));
}

}  // namespace
}  // namespace alidade
