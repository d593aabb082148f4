#include "alidade/detect/video_log.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fmt/format.h>

#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>

#include "alidade/files/files.h"
#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/films/panorama_video.h"
#include "alidade/simulate/rotating_lens.h"
#include "alidade/tables/logs/angle_interpolation.h"
#include "alidade/tables/rotation_log_file.h"
#include "alidade/testing/temporary_folder.h"

namespace alidade {
namespace {

using ::testing::HasSubstr;
using testing::TemporaryFolder;

constexpr std::size_t num_frames = 16;

RotationScene scene_of() {
  RotationScene scene;
  scene.width_px = 160;
  scene.height_px = 120;
  scene.intrinsics = [](double) { return RotatingIntrinsics{150.0, 148.0, 81.0, 58.0}; };
  scene.motion = [](double t_s) { return Eigen::Vector3d(0.3 * t_s, 0.2 * t_s, 0.1 * std::sin(2.0 * t_s)); };
  return scene;
}

RotationLog angles_of(RotationSource source, double rate_hz = 30.0, double duration_s = 0.5) {
  return panorama_log(scene_of(), {.source = source, .rate_hz = rate_hz, .duration_s = duration_s}, 1);
}

/// A folder with the frames of the scene.
class FilmedFolder {
 public:
  FilmedFolder() {
    FarWorld world = FarWorld::of_noise(3.0 / 150.0, 4);
    for (std::size_t k = 0; k < num_frames; ++k) {
      std::vector<unsigned char> bytes;
      cv::imencode(".png", render_panorama_frame(world, scene_of(), k, 30.0, {}, 1), bytes);
      write_file(folder_.path() / fmt::format("frame_{:04}.png", k + 1), std::string(bytes.begin(), bytes.end()));
    }
  }
  [[nodiscard]] const std::filesystem::path& path() const { return folder_.path(); }

  [[nodiscard]] VideoLog log(const RotationLog& angles, const VideoLogConfig& config = {}) const {
    VideoFrames video(path());
    return log_from_video(video, angles, "angles.csv", config);
  }

  [[nodiscard]] std::string refusal(const RotationLog& angles, const VideoLogConfig& config = {}) const {
    try {
      (void)log(angles, config);
    } catch (const InputError& error) {
      return error.what();
    }
    return "";
  }

 private:
  TemporaryFolder folder_;
};

/// Rendered once.
const FilmedFolder& filmed() {
  static const FilmedFolder folder;
  return folder;
}

TEST(VideoLog, HoldsWhatTheCameraSawOneRowAFrame) {
  const FilmedFolder& film = filmed();
  const RotationScene scene = scene_of();
  const VideoLog made = film.log(angles_of(RotationSource::head));
  ASSERT_EQ(made.log.rows.size(), num_frames);
  ASSERT_EQ(made.log.truth.size(), num_frames);
  EXPECT_EQ(made.log.source, RotationSource::head);
  EXPECT_EQ(made.width_px, 160);
  EXPECT_GT(made.log.num_points, 20u);
  EXPECT_GE(made.num_tracks, made.log.num_points);
  EXPECT_GT(made.median_sigma_px, 0.001);
  EXPECT_LT(made.median_sigma_px, 0.05);
  for (std::size_t point = 0; point < made.log.num_points; ++point) {
    std::size_t seen = 0;
    std::optional<Eigen::Vector3d> first_in_base;
    for (const RotationRow& row : made.log.rows) {
      ASSERT_EQ(row.px.size(), made.log.num_points);
      if (!is_seen(row.px[point])) continue;
      ++seen;
      const Eigen::Quaterniond base_from_cam = base_from_cam_rotation(row.pan_tilt_roll_rad);
      if (!first_in_base) first_in_base = base_from_cam * ray_of_px(scene.intrinsics(0.0), row.px[point]);
      const Eigen::Vector3d point_in_cam = base_from_cam.conjugate() * *first_in_base;
      const Eigen::Vector2d expected = px_of_ray(scene.intrinsics(0.0), point_in_cam.head<2>() / point_in_cam.z());
      EXPECT_LT((row.px[point] - expected).norm(), 0.25);  // 0.02 px RMS, in an image of strong perspective
    }
    EXPECT_GE(seen, 10u);
  }
}

TEST(VideoLog, InterpolatesAnglesAtTheFrames) {
  const FilmedFolder& film = filmed();
  RotationLog angles = angles_of(RotationSource::head, 47.0, 0.6);
  const VideoLog made = film.log(angles, {.rate_hz = 30.0});
  ASSERT_EQ(made.log.rows.size(), num_frames);
  for (std::size_t k = 0; k < num_frames; ++k) {
    const double t_s = static_cast<double>(k) / 30.0;
    EXPECT_DOUBLE_EQ(made.log.rows[k].t_s, t_s);
    EXPECT_LT((made.log.rows[k].pan_tilt_roll_rad - scene_of().motion(t_s)).norm(), 1e-6);
  }
}

TEST(VideoLog, KeepsTheRatesBetweenTheFrames) {
  const FilmedFolder& film = filmed();
  const RotationLog angles = angles_of(RotationSource::rate, 100.0, 0.6);
  const VideoLog made = film.log(angles, {.rate_hz = 30.0});
  std::size_t with_pixels = 0;
  for (const RotationRow& row : made.log.rows) with_pixels += std::ranges::any_of(row.px, is_seen);
  EXPECT_EQ(with_pixels, num_frames);
  // 51 samples up to 0.5 s; each third frame (0, 0.1, …) falls on one.
  EXPECT_EQ(made.log.rows.size(), 51u + num_frames - 6u);
  EXPECT_EQ(made.log.truth.size(), made.log.rows.size());
  EXPECT_TRUE(std::ranges::is_sorted(made.log.rows, {}, &RotationRow::t_s));
}

TEST(VideoLog, RefusesAnglesThatDoNotFit) {
  const FilmedFolder& film = filmed();
  EXPECT_THAT(film.refusal(angles_of(RotationSource::head, 30.0, 0.4)), HasSubstr("has 13 rows and the video 16"));
  EXPECT_THAT(film.refusal(angles_of(RotationSource::head, 30.0, 0.4), {.rate_hz = 30.0}),
              HasSubstr("angles.csv: covers t = 0 … 0.4 s, but frame 13 is at 0.433333 s"));
  EXPECT_THAT(film.refusal(angles_of(RotationSource::head), {.min_rows = 1000}), HasSubstr("no point could be"));
}

TEST(VideoLog, StopsWhenAsked) {
  const FilmedFolder& film = filmed();
  VideoFrames video(film.path());
  const Progress stop_at_five = [](std::string_view, std::size_t done, std::size_t) { return done < 5; };
  EXPECT_THROW((void)log_from_video(video, angles_of(RotationSource::head), "", {}, stop_at_five), Interrupted);
}

TEST(ReadAngles, NeedNoPoints) {
  const TemporaryFolder folder;
  const std::filesystem::path file = folder.path() / "angles.csv";
  write_file(file, rotation_log_csv(angles_of(RotationSource::attitude)));
  const RotationLog read = read_angles(file);
  EXPECT_EQ(read.source, RotationSource::attitude);
  EXPECT_EQ(read.rows.size(), num_frames);
  EXPECT_EQ(read.truth.size(), num_frames);
  EXPECT_THROW((void)read_rotation_log(file), InputError);  // a log of points still needs them
  write_file(file, "t,pan,tilt\n");
  EXPECT_THROW((void)read_angles(file), InputError);
  write_file(file, "t,p1x,p1y\n0,1,1\n");
  EXPECT_THROW((void)read_angles(file), InputError);
}

TEST(AngleInterpolation, IsOfThirdOrderForAllSources) {
  // Twice as many rows: 8 times smaller errors at least (16 where the neighbours lie evenly).
  for (const RotationSource source : {RotationSource::head, RotationSource::attitude}) {
    std::array<double, 2> worst{};
    for (int i = 0; i < 2; ++i) {
      const AngleInterpolation interpolation(angles_of(source, i == 0 ? 20.0 : 40.0, 2.0));
      for (double t_s = 0.2; t_s < 1.8; t_s += 0.0137) {
        const RotationRow row = interpolation.at(t_s);
        const Eigen::Quaterniond found =
            source == RotationSource::head ? base_from_cam_rotation(row.pan_tilt_roll_rad) : row.base_from_cam;
        const Eigen::Quaterniond truth = base_from_cam_rotation(scene_of().motion(t_s));
        worst[static_cast<std::size_t>(i)] = std::max(worst[static_cast<std::size_t>(i)], found.angularDistance(truth));
      }
    }
    EXPECT_LT(worst[0], 2e-5);
    EXPECT_LT(worst[1], worst[0] / 7.0);
  }
}

TEST(AngleInterpolation, GoesTheShortWayRoundAndKnowsItsGaps) {
  RotationLog angles;
  angles.source = RotationSource::head;
  for (const double pan : {3.0, 3.1, -3.08318530717958623, -2.98318530717958623}) {
    RotationRow row;
    row.t_s = static_cast<double>(angles.rows.size());
    row.pan_tilt_roll_rad = {pan, 0.0, 0.0};
    angles.rows.push_back(row);
  }
  EXPECT_NEAR(AngleInterpolation(angles).at(1.5).pan_tilt_roll_rad.x(), 3.15, 1e-12);
  angles.rows[2].pan_tilt_roll_rad.setConstant(not_seen);
  const AngleInterpolation with_gap(angles);
  EXPECT_TRUE(std::isnan(with_gap.at(1.5).pan_tilt_roll_rad.x()));
  EXPECT_NEAR(with_gap.at(0.5).pan_tilt_roll_rad.x(), 3.05, 1e-12);
  EXPECT_NEAR(with_gap.at(1.0).pan_tilt_roll_rad.x(), 3.1, 1e-12);
}

}  // namespace
}  // namespace alidade
