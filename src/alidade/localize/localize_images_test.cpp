#include "alidade/localize.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <filesystem>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>

#include "alidade/detect/image_sequence.h"
#include "alidade/localize/checks/judge.h"
#include "alidade/localize/path/whole_path.h"
#include "alidade/simulate/draws.h"
#include "alidade/tables/localize_file.h"
#include "alidade/testing/room_film.h"

namespace alidade {
namespace {

using testing::localized;
using testing::room_camera;
using testing::room_film;
using testing::RoomFilm;
using testing::RoomScene;

/// The same images serve several tests.
const RoomFilm& usual_room() {
  static const RoomFilm video = [] {
    RoomScene scene;
    scene.camera = room_camera();
    return room_film(scene);
  }();
  return video;
}

LocalizeConfig by_hand() {
  LocalizeConfig config;
  config.filter.sigma_a_m_s2 = 4.0;
  config.filter.sigma_alpha_rad_s2 = 6.0;
  config.target = rectangle_target(0.210, 0.1485);
  return config;
}

TEST(LocalizeImages, FollowsARoomWithoutLosingAFrame) {
  const Localization report = localized(usual_room(), by_hand());
  EXPECT_EQ(report.num_lost, 0u);
  EXPECT_LT(report.error.ate_m, 0.005);  // 0.1 px of the rectangle's 60 are 1 mm of 0.7 m; a drift of a few of them
  EXPECT_EQ(report.verdict.exit_code, ExitCode::ok);
  EXPECT_TRUE(report.scale_known);
  for (const PathStep& step : report.path) EXPECT_GE(step.num_tracked, 20u) << step.frame;
}

/// Four in ten matches moved by up to 20 px, or taken away.
Localization disturbed(const RoomFilm& video, bool takes_away, std::uint64_t seed) {
  LocalizeConfig config = by_hand();
  Draws draws(seed);
  config.disturb = [&](long, std::vector<FeatureObservation>& observations) {
    std::vector<FeatureObservation> left;
    for (FeatureObservation& observation : observations) {
      const bool is_wrong = draws.uniform() < 0.4;
      const double v = draws.uniform(-1, 1), u = draws.uniform(-1, 1);
      const Eigen::Vector2d by_px = 20.0 * Eigen::Vector2d(u, v);
      if (is_wrong && takes_away) continue;
      if (is_wrong) observation.px += by_px;
      left.push_back(observation);
    }
    observations = std::move(left);
  };
  return localized(video, config);
}

TEST(LocalizeImages, MismatchesOfFortyPercentChangeLittle) {
  double clean2 = 0.0, wrong2 = 0.0, missing2 = 0.0;
  constexpr int num_draws = 4;
  for (const double amplitude : {1.0, 1.4, 1.8}) {
    RoomScene scene;
    scene.camera = room_camera();
    scene.amplitude = amplitude;
    const RoomFilm video = amplitude == 1.0 ? usual_room() : room_film(scene);
    clean2 += std::pow(localized(video, by_hand()).error.ate_m, 2);
    for (std::uint64_t seed = 1; seed <= num_draws; ++seed) {
      const Localization wrong = disturbed(video, false, seed);
      EXPECT_EQ(wrong.num_lost, 0u) << amplitude << ' ' << seed;
      EXPECT_GT(wrong.num_gated, wrong.num_used / 4) << amplitude << ' ' << seed;
      wrong2 += std::pow(wrong.error.ate_m, 2) / num_draws;
      missing2 += std::pow(disturbed(video, true, seed).error.ate_m, 2) / num_draws;
    }
  }
  RecordProperty("over_clean", std::to_string(std::sqrt(wrong2 / clean2)));
  RecordProperty("over_missing", std::to_string(std::sqrt(wrong2 / missing2)));
  // Being wrong must cost no more than being away.
  EXPECT_LT(std::sqrt(wrong2 / missing2), 1.1);
  EXPECT_LT(std::sqrt(wrong2 / clean2), 1.2);
}

TEST(LocalizeImages, ASecondOfDarknessIsRecoveredWithinTenFrames) {
  RoomFilm video = usual_room();
  for (std::size_t i = 40; i < 70; ++i)
    video.images[i] = cv::Mat(240, 320, CV_8U, cv::Scalar(0));  // zeros() would write into the shared one
  const Localization report = localized(video, by_hand());
  for (std::size_t i = 40; i < 70; ++i) EXPECT_EQ(report.path[i].event, FrameEvent::predicted);
  for (std::size_t i = 80; i < 90; ++i) {
    EXPECT_NE(report.path[i].event, FrameEvent::predicted) << i;
    const Rigid3& is = report.path[i].world_from_cam;
    EXPECT_LT((is.translation - video.truth[i].world_from_cam.translation).norm(), 0.03) << i;  // not somewhere else
  }
}

/// A stream that hangs gives an image again. It shows where the camera was: the pose of the later time is predicted,
/// with the σ of that, and the first image that is another leads back. A camera that stands still is none of these.
TEST(LocalizeImages, ImagesThatRepeatTheLastAreNoObservations) {
  RoomFilm video = usual_room();
  for (std::size_t i = 31; i < 37; ++i) video.images[i] = video.images[30];
  for (std::size_t i = video.images.size() - 8; i < video.images.size(); ++i) video.images[i] = video.images[i - 1];
  const Localization report = localized(video, by_hand());
  EXPECT_EQ(report.num_repeated, 14u);
  EXPECT_EQ(report.verdict.state, State::care);
  EXPECT_NE(report.verdict.sentence.find("14 images are the one before them"), std::string::npos)
      << report.verdict.sentence;
  for (std::size_t i = 0; i < report.path.size(); ++i) {
    const Eigen::Vector3d off = report.path[i].world_from_cam.translation - video.truth[i].world_from_cam.translation;
    EXPECT_LT(off.norm(), 5.0 * std::sqrt(report.path[i].cov.topLeftCorner<3, 3>().trace())) << i;
  }
  RoomFilm still = usual_room();
  std::fill(still.images.begin() + 1, still.images.end(), still.images.front());
  EXPECT_EQ(localized(still, by_hand()).num_repeated, 0u);
}

TEST(LocalizeImages, WithoutTheTargetThereIsNoPath) {
  RoomScene scene;
  scene.camera = room_camera();
  scene.has_rectangle = false;
  scene.num_frames = 5;
  const Localization report = localized(room_film(scene), by_hand());
  EXPECT_EQ(report.num_lost, 5u);
  EXPECT_EQ(report.verdict.exit_code, ExitCode::undetermined);
}

/// Sheets with a dark rectangle each, on a grey wall 0.7 m ahead.
cv::Mat sheets_at(const Camera& camera, const std::vector<double>& places_m) {
  cv::Mat image(camera.height_px, camera.width_px, CV_8U);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const Eigen::Vector3d ray = *unproject(camera, {u, v});
      const Eigen::Vector2d at = 0.7 * ray.hnormalized();
      double grey = 128.0;
      for (const double x : places_m) {
        const double paper = testing::inside(at.x() - x, at.y(), 0.145, 0.115);
        const double dark = testing::inside(at.x() - x, at.y(), 0.105, 0.07425);
        grey += paper * (215.0 - 185.0 * dark - grey);
      }
      image.at<std::uint8_t>(v, u) = cv::saturate_cast<std::uint8_t>(grey);
    }
  }
  return image;
}

/// Two sheets that look the same: a path from the wrong one would be a wrong path with a small σ.
TEST(LocalizeImages, OfTwoThatLookAlikeItTakesNone) {
  RoomFilm video = usual_room();
  video.images.assign(5, sheets_at(video.scene.camera, {-0.2, 0.2}));
  const Localization two = localized(video, by_hand());
  EXPECT_EQ(two.num_lost, 5u);
  EXPECT_EQ(two.num_alike, 2u);
  const Verdict verdict = two.verdict;
  EXPECT_EQ(verdict.exit_code, ExitCode::undetermined);
  EXPECT_NE(verdict.sentence.find("2 things in one image look like the target"), std::string::npos) << verdict.sentence;
  video.images.assign(5, sheets_at(video.scene.camera, {-0.2}));
  EXPECT_EQ(localized(video, by_hand()).path.front().event, FrameEvent::started);
}

/// Points of the target that are known by how they look, instead of a rectangle: the path is the same.
TEST(LocalizeImages, FindsPointsByTheirPatches) {
  LocalizeConfig config = by_hand();
  config.target.rectangle_m.reset();
  const RoomFilm& video = usual_room();
  constexpr int side = 31;
  for (const KnownPoint& point : config.target.points) {
    const auto px = project(video.scene.camera, video.truth[0].world_from_cam.inverse() * point.point_in_world);
    cv::Mat patch;
    cv::getRectSubPix(video.images[0], {side, side}, cv::Point2d(px->x(), px->y()), patch);
    config.target.patches.push_back({side, side, {patch.datastart, patch.dataend}});
  }
  const Localization report = localized(video, config);
  EXPECT_EQ(report.num_lost, 0u);
  EXPECT_LT(report.error.unaligned_m, 0.01);  // its points are found to a tenth of a pixel: 1 mm of 0.7 m, and drift
}

/// Observations that contradict each other for a third of a second: the path begins again instead of following them.
TEST(LocalizeImages, ReinitialisesWhereItsObservationsContradictIt) {
  LocalizeConfig config = by_hand();
  Draws draws(3);
  config.disturb = [&](long frame, std::vector<FeatureObservation>& observations) {
    if (frame < 30 || frame >= 40) return;
    for (FeatureObservation& observation : observations) observation.px += 0.7 * draws.normal2();
  };
  const Localization report = localized(usual_room(), config);
  EXPECT_GE(report.num_restarts, 1u);
  for (std::size_t i = 0; i < 90; ++i) {
    if (i == 30) i = 45;
    const Eigen::Vector3d& is = report.path[i].world_from_cam.translation;
    EXPECT_LT((is - usual_room().truth[i].world_from_cam.translation).norm(), 0.03) << i;
  }
  // The same points are seen before and after it.
  EXPECT_EQ(report.num_untied, 0u);
}

/// What of a reinitialised path is seen on both sides, by how many points, is said: where too few are the same, what is
/// before it may be anywhere, as in another room with the same target.
TEST(LocalizeImages, APathThatIsNotTiedToWhatFollowsIsNotTrusted) {
  Localization report = localized(usual_room(), by_hand());
  ASSERT_EQ(report.num_restarts, 0u);
  report.path[45].event = FrameEvent::restarted;
  report.num_restarts = 1;
  const auto said = [&](long num_shared) {  // points 0 to 9 before, and others after but for so many
    std::vector<PlacedResidual> residuals;
    for (std::size_t k = 0; k < report.path.size(); ++k)
      for (long i = 0; i < 10; ++i)
        residuals.push_back({k, k >= 45 && i >= num_shared ? 100 + i : i, {}, {}, 0.11, 1.0});
    report.num_untied = num_untied(residuals, 0, report.path);
    const Verdict verdict = localize_verdict(report);
    return std::ranges::find(verdict.checks, "restarts", &Check::name)->state;
  };
  EXPECT_EQ(said(8), State::good);
  EXPECT_EQ(said(7), State::care);
  EXPECT_EQ(said(0), State::care);
  EXPECT_NE(localize_verdict(report).sentence.find("do not trust the path before it"), std::string::npos);
  // Points that were last seen long before tie nothing.
  std::vector<PlacedResidual> gap;
  for (std::size_t k = 0; k < report.path.size(); ++k)
    for (long i = 0; i < 10 && (k < 20 || k >= 45); ++i) gap.push_back({k, i, {}, {}, 0.11, 1.0});
  EXPECT_EQ(num_untied(gap, 0, report.path), 1u);
}

RoomFilm with_focal_length(double share) {
  RoomFilm video = usual_room();
  Params<KannalaBrandt> values = std::get<Calibrated<KannalaBrandt>>(video.scene.camera.lens).params;
  values.head<2>() *= share;
  video.scene.camera.lens = Calibrated<KannalaBrandt>{values};
  return video;
}

/// A lens that the images contradict is estimated with the path, named, and the path is as good as with the right one.
TEST(LocalizeImages, AWrongLensIsCorrectedAndNamed) {
  const Localization right = localized(usual_room(), by_hand());
  EXPECT_FALSE(right.given_camera);
  EXPECT_LT(right.error.ate_m, 1.5 * right.error.stated_m);
  const double f = params(usual_room().scene.camera.lens)[0];
  for (const double share : {1.05, 1.3}) {
    const Localization wrong = localized(with_focal_length(share), by_hand());
    ASSERT_TRUE(wrong.given_camera) << share;
    EXPECT_NEAR(params(wrong.camera.lens)[0] / f, 1.0, 0.02) << share;
    EXPECT_LT(wrong.error.ate_m, 0.005) << share;
    EXPECT_LT(wrong.error.unaligned_m, 3.0 * wrong.error.stated_m) << share;
    EXPECT_NE(wrong.verdict.state, State::good);
    EXPECT_EQ(wrong.verdict.checks.end(), std::ranges::find_if(wrong.verdict.checks, [](const Check& check) {
                return check.name == "radial structure" && check.state != State::good;
              }));
    const auto named = std::ranges::find(wrong.verdict.checks, std::string("camera"), &Check::name);
    ASSERT_NE(named, wrong.verdict.checks.end());
    EXPECT_NE(named->text.find("focal length -"), std::string::npos) << named->text;
  }
}

TEST(LocalizeImages, WithoutTextureThereIsNoPath) {
  RoomFilm video = usual_room();
  video.images.resize(10);
  for (cv::Mat& image : video.images) image = cv::Mat(240, 320, CV_8U, cv::Scalar(128));
  LocalizeConfig config = by_hand();
  config.target = {};
  const Localization report = localized(video, config);
  EXPECT_EQ(report.num_lost, 10u);
  EXPECT_NE(report.verdict.exit_code, ExitCode::ok);
}

TEST(LocalizeImages, ARealDeskIsFollowedToACentimetre) {
  const char* data = std::getenv("ALIDADE_DATA");
  const std::filesystem::path folder = std::filesystem::path(data ? data : "") / "data/monoslam-desk";
  if (!data || !std::filesystem::exists(folder))
    GTEST_SKIP() << "set ALIDADE_DATA to the folder that holds data/monoslam-desk";
  Camera camera = room_camera();
  Params<KannalaBrandt> values;
  values << 195.0, 195.0, 162.0, 125.0, 0.0, -0.00893, -0.03290, -0.00519, 0.00191;
  camera.lens = Calibrated<KannalaBrandt>{values};
  const std::vector<TimedPose> truth = read_tum(folder / "reference_tum.txt");
  const Localization report = localize(images_in(folder / "frames", camera, 30.0), camera, by_hand(), truth);
  EXPECT_EQ(report.path.size(), 500u);
  EXPECT_EQ(report.num_lost, 0u);
  EXPECT_LT(report.error.ate_m, 0.005);  // as good as the reference itself
  EXPECT_GT(report.nis_per_dof, 0.8);
  EXPECT_LT(report.nis_per_dof, 1.2);
  double matches = 0.0;
  for (const PathStep& step : report.path) matches += static_cast<double>(step.num_tracked) / 500.0;
  EXPECT_GE(matches, 24.0);
}

}  // namespace
}  // namespace alidade
