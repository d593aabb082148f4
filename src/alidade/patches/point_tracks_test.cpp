#include "alidade/patches/point_tracks.h"

#include <gtest/gtest.h>

#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgproc.hpp>
#include <set>

#include "alidade/simulate/films/panorama_video.h"
#include "alidade/simulate/rotating_lens.h"

namespace alidade {
namespace {

constexpr double rate_hz = 30.0;

/// A head that pans, tilts and rolls, with a distorting lens.
RotationScene scene_of(double speed = 1.0) {
  RotationScene scene;
  scene.width_px = 320;
  scene.height_px = 240;
  scene.intrinsics = [](double) { return RotatingIntrinsics{290.0, 285.0, 162.0, 118.0, -0.1}; };
  scene.motion = [speed](double t_s) {
    Eigen::Vector3d angles = speed * paper_pan_tilt(t_s, 0.0);
    angles += Eigen::Vector3d(0.0, 0.2, 0.15 * std::sin(1.5 * t_s));
    return angles;
  };
  return scene;
}

Eigen::Vector3d direction_of(const RotationScene& scene, std::size_t k, const Eigen::Vector2d& px) {
  const double t_s = static_cast<double>(k) / rate_hz;
  return true_base_from_cam(scene, t_s) * ray_of_px(scene.intrinsics(t_s), px);
}

Eigen::Vector2d px_of(const RotationScene& scene, std::size_t k, const Eigen::Vector3d& point_in_base) {
  const double t_s = static_cast<double>(k) / rate_hz;
  const Eigen::Vector3d point_in_cam = true_base_from_cam(scene, t_s).conjugate() * point_in_base;
  return px_of_ray(scene.intrinsics(t_s), point_in_cam.head<2>() / point_in_cam.z());
}

struct Detection {
  std::size_t frame;
  Eigen::Vector2d px, error;  ///< Against where the point was first seen.
  double sigma_px;
};

using Paint = std::function<void(std::size_t k, cv::Mat& frame)>;

/// Detections of every point, by id, the first included.
std::map<int, std::vector<Detection>> follow(const RotationScene& scene, std::size_t num_frames, double grain_px,
                                             const Paint& paint = {}) {
  FarWorld world = FarWorld::of_noise(grain_px / 290.0, 3);
  PointTracker tracker;
  std::map<int, std::vector<Detection>> tracks;
  std::map<int, Eigen::Vector3d> first;
  for (std::size_t k = 0; k < num_frames; ++k) {
    cv::Mat frame = render_panorama_frame(world, scene, k, rate_hz, {}, 5);
    if (paint) paint(k, frame);
    for (const TrackedPoint& point : tracker.update(frame)) {
      const Eigen::Vector3d direction = first.try_emplace(point.id, direction_of(scene, k, point.px)).first->second;
      tracks[point.id].push_back({k, point.px, point.px - px_of(scene, k, direction), point.sigma_px});
    }
  }
  return tracks;
}

constexpr std::size_t num_frames = 30;

/// Filmed and followed once.
const std::map<int, std::vector<Detection>>& sway() {
  static const std::map<int, std::vector<Detection>> tracks = follow(scene_of(), num_frames, 3.0);
  return tracks;
}

struct ErrorSum {
  double squares = 0.0, count = 0.0;
  Eigen::Vector2d sum = Eigen::Vector2d::Zero();

  void add(const Eigen::Vector2d& error) {
    squares += 0.5 * error.squaredNorm();
    sum += error;
    count += 1.0;
  }
  [[nodiscard]] double rms() const { return std::sqrt(squares / count); }
  [[nodiscard]] Eigen::Vector2d mean() const { return sum / count; }
};

TEST(PointTracker, FollowsToHundredthsOfAPixelWithoutDrift) {
  ErrorSum young, old, all, whitened;
  for (const auto& [id, detections] : sway()) {
    if (detections.size() < 10) continue;
    Eigen::Vector2d centre = Eigen::Vector2d::Zero();
    for (const Detection& s : detections) centre += s.error / static_cast<double>(detections.size());
    const double freed = static_cast<double>(detections.size()) / static_cast<double>(detections.size() - 1);
    for (const Detection& s : detections) {
      whitened.add((s.error - centre) * std::sqrt(freed) / s.sigma_px);
      if (s.frame == detections[0].frame) continue;
      all.add(s.error);
      (s.frame - detections[0].frame < 10 ? young : old).add(s.error);
    }
  }
  ASSERT_GT(all.count, 2000.0);
  EXPECT_LT(all.rms(), 0.05);  // the goal at σ = 2 grey values; 0.016 is seen
  EXPECT_LT(all.mean().cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT(old.mean().cwiseAbs().maxCoeff(), 0.02);
  EXPECT_LT(old.rms(), 1.25 * young.rms());  // no drift: it would add up
  EXPECT_NEAR(whitened.rms(), 1.0, 0.25);    // σ is honest
}

TEST(PointTracker, KeepsWhatStaysInTheImage) {
  const RotationScene scene = scene_of();
  int stayed = 0, kept = 0;
  std::set<std::pair<int, int>> cells;
  for (const auto& [id, detections] : sway()) {
    if (detections[0].frame != 0) continue;
    cells.emplace(static_cast<int>(detections[0].px.x()) / 80, static_cast<int>(detections[0].px.y()) / 80);
    const Eigen::Vector3d direction = direction_of(scene, 0, detections[0].px);
    bool stays = true;
    for (std::size_t k = 0; k < num_frames; ++k) {
      const Eigen::Vector2d px = px_of(scene, k, direction);
      stays = stays && px.x() > 12.0 && px.y() > 12.0 && px.x() < 307.0 && px.y() < 227.0;
    }
    stayed += stays;
    kept += stays && detections.size() == num_frames;
  }
  EXPECT_EQ(cells.size(), 12u);  // all of the image has points
  EXPECT_GT(stayed, 80);
  EXPECT_GE(kept, stayed * 9 / 10);
}

TEST(PointTracker, FollowsFastTurns) {
  const auto tracks = follow(scene_of(8.0), 12, 8.0);  // up to 14 px a frame
  ErrorSum all;
  for (const auto& [id, detections] : tracks)
    for (const Detection& s : detections)
      if (s.frame != detections[0].frame) all.add(s.error);
  ASSERT_GT(all.count, 300.0);
  EXPECT_LT(all.rms(), 0.1);  // coarser grains, stronger warps
}

TEST(PointTracker, DropsWhatIsCoveredInsteadOfSlipping) {
  FarWorld other = FarWorld::of_noise(3.0 / 290.0, 99);
  const cv::Mat poster = render_panorama_frame(other, scene_of(), 0, rate_hz, {}, 5);
  const cv::Rect covered(120, 80, 100, 90);
  const auto tracks = follow(scene_of(), 12, 3.0, [&](std::size_t k, cv::Mat& frame) {
    if (k >= 6) poster(covered).copyTo(frame(covered));
  });
  for (const auto& [id, detections] : tracks) {
    if (detections[0].frame >= 6) continue;  // may be a point of the poster
    for (const Detection& s : detections) EXPECT_LT(s.error.norm(), 1.0) << "point " << id << " in frame " << s.frame;
  }
}

TEST(PointTracker, FindsNothingOnAWallAndStartsAgainWithAnotherSize) {
  PointTracker tracker;
  EXPECT_TRUE(tracker.update(cv::Mat(240, 320, CV_8U, cv::Scalar(100))).empty());
  FarWorld world = FarWorld::of_noise(3.0 / 290.0, 3);
  const cv::Mat frame = render_panorama_frame(world, scene_of(), 0, rate_hz, {}, 5);
  for (int k = 0; k < 6; ++k) (void)tracker.update(frame);
  const int last_id = tracker.update(frame).back().id;
  const auto& seen = tracker.update(frame(cv::Rect(0, 0, 200, 160)).clone());
  ASSERT_FALSE(seen.empty());
  EXPECT_GT(seen.front().id, last_id);
  EXPECT_TRUE(tracker.update(cv::Mat(8, 8, CV_8U, cv::Scalar(100))).empty());
}

}  // namespace
}  // namespace alidade
