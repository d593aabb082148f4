#include "alidade/results/seen_frames.h"

#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>

namespace alidade {
namespace {

nlohmann::json document_of(const SeenFrames& frames) {
  JobOutcome outcome;
  outcome.document.command = "localize";
  frames.add_to(outcome);
  return nlohmann::json::parse(result_text(outcome.document))["data"];
}

SeenFrames shown(std::size_t said, std::size_t num) {
  SeenFrames frames(said, true);
  for (std::size_t i = 0; i < num; ++i) {
    ObservationTried found{7, {10.004, 20.0}, Eigen::Matrix2d::Identity(), Eigen::Vector2d(11.0, 20.5), true};
    ObservationTried lost{8, {30.0, 40.0}, 4.0 * Eigen::Matrix2d::Identity(), {}, false};
    frames.offer(0.1 * static_cast<double>(i), cv::Mat(48, 64, CV_8U, cv::Scalar(128)), std::array{found, lost});
  }
  return frames;
}

TEST(SeenFrames, KeepsSomeEvenlyHoweverManyThereAre) {
  for (const std::size_t said : {0u, 1000u, 300u}) {
    const SeenFrames frames = shown(said, 1000);
    const nlohmann::json data = document_of(frames);
    const auto t_s = data["frames"]["t_s"].get<std::vector<double>>();
    EXPECT_GE(t_s.size(), 12u) << said;
    EXPECT_LE(t_s.size(), 24u) << said;
    for (std::size_t i = 2; i < t_s.size(); ++i) EXPECT_NEAR(t_s[i] - t_s[i - 1], t_s[1] - t_s[0], 1e-9) << said;
    EXPECT_EQ(t_s.front(), 0.0);
    EXPECT_GT(t_s.back(), 85.0);
    JobOutcome outcome;
    frames.add_to(outcome);
    ASSERT_EQ(outcome.images.size(), t_s.size());
    for (std::size_t i = 0; i < t_s.size(); ++i) {
      EXPECT_EQ(outcome.images[i].name, data["frames"]["name"][i].get<std::string>());
      EXPECT_EQ(outcome.images[i].bytes.substr(0, 2), "\xff\xd8");
    }
  }
}

TEST(SeenFrames, SaysWhatWasExpectedAndFound) {
  const nlohmann::json data = document_of(shown(2, 2)), observations = data["sights"];
  EXPECT_EQ(observations["frame"], nlohmann::json({0, 0, 1, 1}));
  EXPECT_EQ(observations["id"], nlohmann::json({7, 8, 7, 8}));
  EXPECT_EQ(observations["expected_u_px"][0], 10.0);
  EXPECT_EQ(observations["cov_vv_px2"][1], 4.0);
  EXPECT_EQ(observations["u_px"][0], 11.0);
  EXPECT_TRUE(observations["u_px"][1].is_null());
  EXPECT_EQ(observations["used"], nlohmann::json({true, false, true, false}));
}

TEST(SeenFrames, WithoutAPageTheTablesAreTheSame) {
  SeenFrames frames(1, false);
  frames.offer(0.0, cv::Mat(48, 64, CV_8U, cv::Scalar(128)), {});
  EXPECT_EQ(frames.num_images(), 0u);
  EXPECT_EQ(document_of(frames)["frames"]["width_px"], nlohmann::json({64}));
}

TEST(SeenFrames, WithoutImagesThereIsNoTable) { EXPECT_TRUE(document_of(SeenFrames(10, true)).empty()); }

}  // namespace
}  // namespace alidade
