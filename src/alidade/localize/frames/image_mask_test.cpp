#include "alidade/localize/frames/image_mask.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

namespace alidade {
namespace {

bool shows(const ImageMask& mask, int u, int v) {
  return mask.shows.at(static_cast<std::size_t>(v * mask.width_px + u)) != 0;
}

TEST(ImageMask, ACircleIsFoundAndPatchesStayInIt) {
  cv::Mat grey(240, 320, CV_8U, cv::Scalar(3));
  cv::circle(grey, {160, 118}, 100, cv::Scalar(120), cv::FILLED);
  cv::rectangle(grey, {110, 80}, {150, 120}, cv::Scalar(5), cv::FILLED);  // dark inside
  LocalizeConfig config;
  EXPECT_TRUE(shown_part(config, grey, 8).mask.shows.empty());
  config.masks_circle = true;
  EXPECT_FALSE(shown_part(config, grey, 8).lacks_circle);
  const ImageMask shown = shown_part(config, grey, 8).mask;
  EXPECT_EQ(shows(shown, 160, 118), true);
  EXPECT_EQ(shows(shown, 130, 100), true);
  EXPECT_EQ(shows(shown, 160 + 88, 118), true);
  EXPECT_EQ(shows(shown, 160 + 96, 118), false);
  EXPECT_EQ(shows(shown, 10, 10), false);
}

TEST(ImageMask, WhereThereIsNoCircleNothingIsMaskedAndThatIsSaid) {
  LocalizeConfig config;
  config.masks_circle = true;
  const cv::Mat full(240, 320, CV_8U, cv::Scalar(120)), dark(240, 320, CV_8U, cv::Scalar(0));
  cv::Mat bar(240, 320, CV_8U, cv::Scalar(3)), corner = bar.clone();
  cv::rectangle(bar, {20, 100}, {300, 140}, cv::Scalar(120), cv::FILLED);
  cv::rectangle(corner, {0, 0}, {120, 120}, cv::Scalar(120), cv::FILLED);
  for (const cv::Mat& grey : {full, dark, bar, corner}) {
    const ShownPart part = shown_part(config, grey, 8);
    EXPECT_TRUE(part.lacks_circle);
    EXPECT_TRUE(part.mask.shows.empty());
  }
  // Wider than the image is high, as an endoscope's often is.
  cv::Mat wide(240, 320, CV_8U, cv::Scalar(3));
  cv::circle(wide, {160, 120}, 140, cv::Scalar(120), cv::FILLED);
  EXPECT_FALSE(shown_part(config, wide, 8).lacks_circle);
}

TEST(ImageMask, AGivenMaskIsTakenWithItsMargin) {
  const cv::Mat grey(20, 30, CV_8U, cv::Scalar(100));
  LocalizeConfig config;
  config.mask = ImageMask{30, 20, std::vector<std::uint8_t>(600, 1)};
  for (int v = 0; v < 20; ++v) config.mask->shows[static_cast<std::size_t>(30 * v + 15)] = 0;
  const ImageMask shown = shown_part(config, grey, 2).mask;
  EXPECT_EQ(shows(shown, 12, 10), true);
  EXPECT_EQ(shows(shown, 13, 10), false);
  EXPECT_EQ(shows(shown, 17, 10), false);
  EXPECT_EQ(shows(shown, 18, 10), true);
}

}  // namespace
}  // namespace alidade
