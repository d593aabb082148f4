#include "alidade/heads/streams/frame_follower.h"

#include <gtest/gtest.h>

#include <opencv2/core.hpp>

namespace alidade {
namespace {

/// Ten a second, all of them here at once: the points in them are followed far behind time.
void push_all(FrameFollower& follower, int num_frames) {
  cv::Mat image(480, 640, CV_8U);
  cv::RNG(5).fill(image, cv::RNG::UNIFORM, 0, 255);
  const auto shared = std::make_shared<const cv::Mat>(image);
  for (int i = 0; i < num_frames; ++i) follower.push({0.1 * i, FrameTimes::stamped, 0.0, 0.1 * i, shared});
}

TEST(FrameFollower, TakesTheNewestWhereItIsLate) {
  constexpr int num_frames = 60;
  FrameFollower follower;
  push_all(follower, num_frames);
  const std::vector<SeenFrame> seen = follower.seen();
  EXPECT_EQ(seen.size() + follower.num_skipped(), static_cast<std::size_t>(num_frames));
  EXPECT_LT(seen.size(), 20u);
  EXPECT_DOUBLE_EQ(seen.back().t_s, 0.1 * (num_frames - 1));
  for (std::size_t i = 1; i < seen.size(); ++i) EXPECT_GT(seen[i].t_s, seen[i - 1].t_s);
}

TEST(FrameFollower, SkipsNoneOfAClockThatWaits) {
  FrameFollower follower({}, true);
  push_all(follower, 12);
  EXPECT_EQ(follower.seen().size(), 12u);
  EXPECT_EQ(follower.num_skipped(), 0u);
}

/// A few that a network sends in one piece are not late.
TEST(FrameFollower, KeepsABurst) {
  FrameFollower follower;
  cv::Mat image(240, 320, CV_8U, cv::Scalar(90));
  const auto shared = std::make_shared<const cv::Mat>(image);
  for (int i = 0; i < 6; ++i) follower.push({0.04 * i, FrameTimes::stamped, 0.0, 0.2 + 1e-3 * i, shared});
  EXPECT_EQ(follower.seen().size(), 6u);
}

}  // namespace
}  // namespace alidade
