#include "alidade/heads/calibration/stars.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>
#include <string>

#include "alidade/files/files.h"
#include "alidade/heads/streams/fits_image.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// A card of a FITS header: its keyword in eight places, "= ", its value to the 30th.
std::string card(std::string key, const std::string& value) {
  key.resize(8, ' ');
  std::string text = key + "= " + std::string(value.size() < 20 ? 20 - value.size() : 0, ' ') + value;
  text.resize(80, ' ');
  return text;
}

/// 3 × 2 pixels of 16 bits, as astronomers' cameras write them: without a sign, by BZERO.
std::string small_fits() {
  std::string bytes = card("SIMPLE", "T") + card("BITPIX", "16") + card("NAXIS", "2") + card("NAXIS1", "3") +
                      card("NAXIS2", "2") + card("BZERO", "32768") + card("BSCALE", "1") +
                      card("EXPTIME", "5.000000E-01 / seconds") + card("DATE-OBS", "'2026-11-24T16:15:36.446'") + "END";
  bytes.resize(2880, ' ');
  for (const int value : {0, 1, 256, 32768, 65535, 1000}) {
    const int stored = value - 32768;
    bytes += static_cast<char>(stored >> 8 & 255);
    bytes += static_cast<char>(stored & 255);
  }
  bytes.resize(2 * 2880, '\0');
  return bytes;
}

TEST(FitsImage, ValuesAndTimes) {
  const FitsImage image = read_fits(small_fits(), "test");
  ASSERT_EQ(image.width_px, 3);
  ASSERT_EQ(image.height_px, 2);
  EXPECT_EQ(image.values[0], 0.0);
  EXPECT_EQ(image.values[2], 256.0);
  EXPECT_EQ(image.values[3], 32768.0);
  EXPECT_EQ(image.values[4], 65535.0);
  EXPECT_EQ(image.exposure_s, 0.5);
  EXPECT_NEAR(image.begin_s, 1795536936.446, 1e-6);  // by `date -u -d 2026-11-24T16:15:36.446 +%s.%N`
}

TEST(FitsImage, WhatIsNoneIsRefused) {
  const std::string whole = small_fits();
  EXPECT_THROW((void)read_fits(whole.substr(0, 2885), "test"), InputError);
  EXPECT_THROW((void)read_fits("", "test"), InputError);
  EXPECT_THROW((void)read_fits(std::string(4000, 'x'), "test"), InputError);
  std::string other = whole;
  other.replace(other.find("BITPIX"), 80, card("BITPIX", "12"));
  EXPECT_THROW((void)read_fits(other, "test"), InputError);
}

TEST(Stars, AreFoundAgainByHowTheyLie) {
  Draws draws(4);
  std::vector<Eigen::Vector2d> sky;
  for (int i = 0; i < 200; ++i) sky.emplace_back(draws.uniform(-400.0, 1200.0), draws.uniform(-400.0, 1000.0));
  const auto image_at = [&](const Eigen::Vector2d& shift) {
    cv::Mat grey(600, 800, CV_8U, cv::Scalar(10));
    for (const Eigen::Vector2d& star : sky) {
      const Eigen::Vector2d px = star + shift;
      const cv::Point at(static_cast<int>(std::lround(px.x())), static_cast<int>(std::lround(px.y())));
      if (cv::Rect(0, 0, 800, 600).contains(at)) grey.at<uchar>(at) = 120;
    }
    return grey;
  };
  StarTracks tracks;
  const auto first = tracks.update(find_stars(image_at({0, 0})), {0, 0});
  const auto second = tracks.update(find_stars(image_at({290.3, -140.6})), {0.1, 0});
  ASSERT_GT(first.size(), 20u);
  ASSERT_TRUE(tracks.last_shift());
  EXPECT_LT((tracks.last_shift()->shift_px - Eigen::Vector2d(290.3, -140.6)).norm(), 1.0);
  int again = 0;
  for (const TrackedPoint& point : second)
    for (const TrackedPoint& before : first) {
      if (point.id != before.id) continue;
      ++again;
      EXPECT_LT((point.px - before.px - Eigen::Vector2d(290.3, -140.6)).norm(), 1.5);
    }
  EXPECT_GT(again, 10);
  const cv::Mat another = [&] {
    for (Eigen::Vector2d& star : sky) star = {draws.uniform(0.0, 800.0), draws.uniform(0.0, 600.0)};
    return image_at({0, 0});
  }();
  EXPECT_TRUE(tracks.update(find_stars(another), {0.2, 0}).empty());
}

}  // namespace
}  // namespace alidade
