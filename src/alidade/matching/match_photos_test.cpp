#include "alidade/matching/match_photos.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <stdexcept>

namespace alidade {
namespace {

using ::testing::HasSubstr;
using ::testing::StartsWith;

/// Blobs of many sizes.
cv::Mat texture(int width, int height) {
  cv::Mat sum(height, width, CV_32F, cv::Scalar(0)), noise(height, width, CV_32F);
  cv::RNG random(7);
  for (const double blur : {1.5, 3.0, 6.0, 12.0}) {
    random.fill(noise, cv::RNG::NORMAL, 0.0, 40.0 * blur);
    cv::Mat soft;
    cv::GaussianBlur(noise, soft, {}, blur);
    sum += soft;
  }
  cv::Mat grey;
  sum.convertTo(grey, CV_8U, 1.0, 128.0);
  return grey;
}

/// Where a point of the first image is in the rotated one.
cv::Mat turned(const cv::Mat& image, cv::Mat& map) {
  map = cv::getRotationMatrix2D({320.0F, 240.0F}, 12.0, 1.0);
  map.at<double>(0, 2) += 35.5;
  cv::Mat out;
  cv::warpAffine(image, out, map, image.size(), cv::INTER_CUBIC);
  return out;
}

TEST(MatchPhotos, FindsThePointsOfATurnedImageAgain) {
  const cv::Mat first = texture(640, 480);
  cv::Mat map, second;
  cv::cvtColor(turned(first, map), second, cv::COLOR_GRAY2BGR);  // colour beside grey
  const std::vector<cv::Mat> images{first, second};
  const PhotoMatches found = match_photos({"a", "b"}, [&](std::size_t i) { return images[i]; });
  ASSERT_EQ(found.photos.pairs.size(), 1u);
  const MatchedPair& pair = found.photos.pairs.front();
  EXPECT_GT(pair.matches.size(), 200u);
  std::size_t right = 0;
  for (const FeatureMatch& match : pair.matches) {
    const Eigen::Vector2d a = found.photos.features[0][static_cast<std::size_t>(match.a)];
    const Eigen::Vector2d b = found.photos.features[1][static_cast<std::size_t>(match.b)];
    const auto at = [&](int row) {
      return map.at<double>(row, 0) * a.x() + map.at<double>(row, 1) * a.y() + map.at<double>(row, 2);
    };
    right += (b - Eigen::Vector2d(at(0), at(1))).norm() < 1.0 ? 1u : 0u;
  }
  EXPECT_GT(right, pair.matches.size() * 95 / 100);
}

TEST(MatchPhotos, ALargePhotoIsLookedAtSmallerAndItsPointsStayWhereTheyAre) {
  const cv::Mat small = texture(640, 480);
  cv::Mat large;
  cv::resize(small, large, {}, 3.0, 3.0, cv::INTER_CUBIC);
  const PhotoFeatures a = find_features(small), b = find_features(large, {.max_megapixels = 0.3072});
  const auto matches = match_features(a.descriptors, b.descriptors);
  ASSERT_GT(matches.size(), 300u);
  std::vector<double> off;
  for (const FeatureMatch& match : matches) {
    const Eigen::Vector2d in_small = a.px[static_cast<std::size_t>(match.a)];
    const Eigen::Vector2d in_large = b.px[static_cast<std::size_t>(match.b)];
    off.push_back(((in_large.array() + 0.5) / 3.0 - 0.5 - in_small.array()).matrix().norm());
  }
  std::nth_element(off.begin(), off.begin() + static_cast<std::ptrdiff_t>(off.size() / 2), off.end());
  EXPECT_LT(off[off.size() / 2], 0.15);
}

/// Of an image and the same one upside down the same points are at mirrored positions: a shift of all positions shows
/// twice. A quarter of a pixel was 8 to 15 sigma of the principal point of eight photos.
TEST(MatchPhotos, PositionsAreNotShifted) {
  const cv::Mat image = texture(640, 480);
  cv::Mat turned;
  cv::rotate(image, turned, cv::ROTATE_180);
  const PhotoFeatures a = find_features(image), b = find_features(turned);
  const auto matches = match_features(a.descriptors, b.descriptors);
  ASSERT_GT(matches.size(), 300u);
  for (const int axis : {0, 1}) {
    const double last_px = axis == 0 ? 639.0 : 479.0;
    std::vector<double> shift;
    for (const FeatureMatch& match : matches)
      shift.push_back(0.5 * (a.px[static_cast<std::size_t>(match.a)][axis] +
                             b.px[static_cast<std::size_t>(match.b)][axis] - last_px));
    std::nth_element(shift.begin(), shift.begin() + static_cast<std::ptrdiff_t>(shift.size() / 2), shift.end());
    EXPECT_NEAR(shift[shift.size() / 2], 0.0, 0.03);
  }
}

TEST(MatchPhotos, NamesWhatTakesNoPart) {
  const cv::Mat image = texture(320, 240);
  cv::Mat upright;
  cv::rotate(image, upright, cv::ROTATE_90_CLOCKWISE);
  const std::vector<cv::Mat> images{image, image, upright, cv::Mat(240, 320, CV_8U, cv::Scalar(90)), cv::Mat()};
  const PhotoMatches found = match_photos({"a", "b", "upright", "plain", "broken"}, [&](std::size_t i) {
    if (images[i].empty()) throw std::runtime_error("is cut off");
    return images[i];
  });
  EXPECT_EQ(found.photos.width_px, 320);
  EXPECT_EQ(found.reasons[0], "");
  EXPECT_THAT(found.reasons[2], StartsWith("is 240x320, but most photos are 320x240: its pixels were turned"));
  EXPECT_THAT(found.reasons[3], HasSubstr("nothing that could be known again"));
  EXPECT_EQ(found.reasons[4], "is cut off");
  EXPECT_EQ(found.num_unreadable, 1u);
  EXPECT_EQ(found.photos.pairs.size(), 1u);
}

}  // namespace
}  // namespace alidade
