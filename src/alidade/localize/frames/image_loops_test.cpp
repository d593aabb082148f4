#include <gtest/gtest.h>

#include <cmath>
#include <numbers>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/geometry/so3.h"
#include "alidade/localize.h"
#include "alidade/localize/frames/landmark_descriptions.h"
#include "alidade/patches/corner_features.h"
#include "alidade/testing/room_film.h"

// Places that a camera comes back to are recognised in its images, and the path is solved with that.

namespace alidade {
namespace {

using testing::RoomFilm;
using testing::RoomScene;

/// Along a wall, 1.2 m before it: so many metres, and back in as many images as on the way.
RoomFilm along_wall(double length_m, double num_there, std::size_t num, long num_columns) {
  RoomFilm film;
  film.scene.camera = testing::room_camera();
  film.scene.has_rectangle = false;
  film.scene.num_columns = num_columns;
  for (std::size_t i = 0; i < num; ++i) {
    const double t = 0.5 * static_cast<double>(i) / num_there;
    const Eigen::Vector3d position(0.5 * length_m * (1.0 - std::cos(2.0 * std::numbers::pi * t)),
                                   -0.03 + 0.03 * std::sin(60.0 * t), -0.7 + 0.04 * std::sin(43.0 * t));
    const Rigid3 world_from_cam{
        exp_so3(Eigen::Vector3d(0.03 * std::sin(37.0 * t), 0.05 * std::sin(29.0 * t), 0.02 * std::sin(23.0 * t))),
        position};
    film.take(i, world_from_cam);
  }
  return film;
}

LocalizeConfig with_few_landmarks() {
  LocalizeConfig config;
  config.features.max_features = 60;  // the map is full after two metres
  return config;
}

TEST(ImageLoops, WhereTheCameraComesBackThePathCloses) {
  const RoomFilm film = along_wall(3.2, 120.0, 240, 0);
  const Localization report = localized(film, with_few_landmarks());
  EXPECT_TRUE(report.is_smoothed);
  EXPECT_GE(report.num_loops, 1u);
  EXPECT_EQ(report.num_lost, 0u);
  RecordProperty("ate_m", std::to_string(report.error.ate_m));
  RecordProperty("stated_m", std::to_string(report.error.stated_m));
  EXPECT_LT(report.error.ate_m, 3.0 * report.error.stated_m);
  std::size_t num_twice = 0;  // corners that are looked for are farther apart than this
  for (std::size_t i = 0; i < report.map.size(); ++i)
    for (std::size_t j = 0; j < i; ++j)
      num_twice += (report.map[i].point_in_world - report.map[j].point_in_world).norm() < 0.004 ? 1 : 0;
  RecordProperty("num_twice", std::to_string(num_twice));
  EXPECT_EQ(num_twice, 0u);
  // Innovations of patches, whose errors last, are small; that σ is too large does not follow.
  RecordProperty("nis", std::to_string(report.nis_per_dof));
  EXPECT_EQ(report.verdict.sentence.find("too large"), std::string::npos) << report.verdict.sentence;
}

/// A wall that repeats itself after .8 m is no place come back to.
TEST(ImageLoops, AlikePlacesAreNotTakenForOne) {
  const RoomFilm film = along_wall(4.8, 240.0, 240, 18);
  const Localization report = localized(film, with_few_landmarks());
  EXPECT_TRUE(report.is_smoothed);
  EXPECT_EQ(report.num_loops, 0u);
  EXPECT_GE(report.num_loops_rejected, 1u);
  RecordProperty("ate_m", std::to_string(report.error.ate_m));
  EXPECT_LT(report.error.ate_m, 0.05);
}

/// An image against another of the same: shifted, and from a quarter nearer.
TEST(LandmarkDescriptions, FindsLandmarksWithoutKnowingWhereToLook) {
  RoomScene scene;
  scene.camera = testing::room_camera();
  const cv::Mat before = testing::render_room(scene, {Eigen::Quaterniond::Identity(), {0.0, 0.0, -0.7}}, 1);
  std::vector<LandmarkSeen> landmarks;
  for (const CornerFeature& corner : corners_in_empty_cells(before, {}, {.cell_px = 32, .margin_px = 40}))
    landmarks.push_back({static_cast<long>(landmarks.size()), corner.px.cast<double>()});
  LandmarkDescriptions descriptions;
  descriptions.add(before, 0, landmarks);
  for (const double larger : {1.0, 1.25}) {
    const Eigen::Vector2d centre(160.0, 120.0), shift_px(17.0, -9.0);
    const cv::Matx23d to(larger, 0.0, centre.x() * (1.0 - larger) + shift_px.x(), 0.0, larger,
                         centre.y() * (1.0 - larger) + shift_px.y());
    cv::Mat now;
    cv::warpAffine(before, now, to, before.size());
    const auto matches = descriptions.matches(now, 200, 8, 3);
    ASSERT_EQ(matches.size(), 1u) << larger;
    EXPECT_GE(2 * matches.front().size(), landmarks.size()) << larger;
    std::size_t num_right = 0;
    for (const LandmarkSeen& match : matches.front()) {
      const Eigen::Vector2d& was = landmarks[static_cast<std::size_t>(match.id)].px;
      num_right += (centre + larger * (was - centre) + shift_px - match.px).norm() < 3.0 ? 1 : 0;
    }
    EXPECT_GE(10 * num_right, 8 * matches.front().size()) << larger;
  }
  EXPECT_TRUE(descriptions.matches(before, 0, 8, 3).empty());  // nothing is so old
}

}  // namespace
}  // namespace alidade
