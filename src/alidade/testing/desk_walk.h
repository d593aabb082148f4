#pragma once

#include <Eigen/LU>
#include <algorithm>
#include <map>

#include "alidade/localize/frames/image_localizer.h"
#include "alidade/testing/room_video.h"

namespace alidade::testing {

/// A camera moved by hand in front of a desk, as room_video.h has it, but with points instead of images: features
/// enter where fewer than thirty are in view, by where they are first seen, and leave where the map is full.
struct DeskWalk {
  int num_frames = 500;
  double sigma_px = 0.15;  ///< Of a match.
  double sigma_corner_px = 0.2, sigma_known_m = 0.001;
  LocalizationFilterConfig filter;  ///< See desk_filter().
};

inline LocalizationFilterConfig desk_filter() {
  LocalizationFilterConfig config;
  config.sigma_a_m_s2 = 4.0;
  config.sigma_alpha_rad_s2 = 6.0;
  config.state_capacity = 760;
  config.observations_capacity = 80;
  return for_images(config, ImageFeatureConfig{}.sigma_floor_px);
}

/// Of each frame: eᵀP⁻¹e of the position over 3 and of the pose over 6, and the filter's NIS.
struct DeskRun {
  std::vector<double> position_nees, pose_nees;
  double error_m = 0.0, sigma_m = 0.0;  ///< In the last frame.
  double nis_per_dof = 0.0;
};

class DeskWalker {
 public:
  DeskWalker(const DeskWalk& walk, std::uint64_t seed) : walk_(walk), draws_(seed), camera_(room_camera()) {
    RoomScene scene;
    scene.camera = camera_;
    scene.num_frames = walk.num_frames;
    scene.amplitude = draws_.uniform(1.2, 2.0);
    path_ = room_path(scene);
    known_ = rectangle_target(0.210, 0.1485, walk.sigma_known_m).points;
    for (const KnownPoint& point : known_)
      points_.push_back(point.point_in_world + walk.sigma_known_m * draws_.normal3());
    for (int i = 0; i < 1500; ++i) {
      const double z = draws_.uniform(-0.3, 0.8), y = draws_.uniform(-1.2, 0.6), x = draws_.uniform(-1.5, 1.5);
      points_.emplace_back(x, y, z);
    }
  }

  DeskRun run() {
    DeskRun run;
    start();
    double num = 0.0;
    for (frame_ = 0; frame_ < path_.size(); ++frame_) {
      if (frame_ > 0) {
        bank_->predict(1.0 / 30.0);
        const ObservationsReport report = bank_->update(observations());
        run.nis_per_dof += report.nis_per_dof * static_cast<double>(report.num_used);
        num += static_cast<double>(report.num_used);
        bank_->convert_linear();
      }
      add_new();
      judge(run);
    }
    run.nis_per_dof /= num;
    return run;
  }

 private:
  [[nodiscard]] std::optional<Eigen::Vector2d> seen(std::size_t id) const {
    const Eigen::Vector3d point_in_cam = path_[frame_].inverse() * points_[id];
    if (point_in_cam.z() < 0.1) return std::nullopt;
    const auto px = project(camera_, point_in_cam);
    constexpr double margin_px = 14.0;
    if (!px || px->minCoeff() < margin_px || px->x() > camera_.width_px - margin_px ||
        px->y() > camera_.height_px - margin_px)
      return std::nullopt;
    return px;
  }

  void start() {
    std::vector<FeatureObservation> corners;
    for (const KnownPoint& point : known_)
      corners.push_back({point.id, *seen(static_cast<std::size_t>(point.id)) + walk_.sigma_corner_px * draws_.normal2(),
                         walk_.sigma_corner_px});
    std::vector<StartHypothesis> starts = poses_from_known(camera_, corners, known_);
    for (StartHypothesis& start : starts) start.cov.topLeftCorner<6, 6>() *= 100.0;
    bank_.emplace(camera_, starts, walk_.filter, FilterBankConfig{.splits = 1});
    for (const KnownPoint& point : known_) bank_->add_known(point.id, point.point_in_world, point.sigma_m);
    bank_->update(corners);
  }

  std::vector<FeatureObservation> observations() {
    std::vector<FeatureObservation> observations;
    for (const Feature& feature : bank_->best().features()) {
      const auto px = seen(static_cast<std::size_t>(feature.id));
      if (!px || observations.size() >= 44) continue;
      observations.push_back({feature.id, *px + walk_.sigma_px * draws_.normal2(), walk_.sigma_px});
      last_seen_[feature.id] = frame_;
    }
    return observations;
  }

  void add_new() {
    std::size_t in_view = 0;
    for (const Feature& feature : bank_->best().features())
      in_view += seen(static_cast<std::size_t>(feature.id)) ? 1u : 0u;
    std::size_t most = frame_ == 0 ? 30 : 8;
    for (std::size_t id = known_.size(); id < points_.size() && in_view < 30 && most > 0; ++id) {
      const auto px = seen(id);
      if (!px || bank_->best().has(static_cast<long>(id))) continue;
      if (last_seen_.size() >= 120) forget_oldest();
      constexpr double depth_m = 0.8;
      if (!bank_->add(static_cast<long>(id), *px, {depth_m / std::max(unproject(camera_, *px)->z(), 0.2), 0.5}))
        continue;
      last_seen_[static_cast<long>(id)] = frame_;
      ++in_view;
      --most;
    }
  }

  void forget_oldest() {
    auto oldest = last_seen_.end();
    for (auto at = last_seen_.begin(); at != last_seen_.end(); ++at) {
      const bool is_known = at->first < static_cast<long>(known_.size());
      if (!is_known && (oldest == last_seen_.end() || at->second < oldest->second)) oldest = at;
    }
    bank_->remove(oldest->first);
    last_seen_.erase(oldest);
  }

  void judge(DeskRun& run) const {
    const LocalizationFilter& filter = bank_->best();
    const Eigen::Matrix<double, 6, 6> P = filter.pose_covariance();
    const Rigid3 is_from_true = filter.motion().world_from_cam.inverse() * path_[frame_];
    Eigen::Vector<double, 6> e;
    e << is_from_true.translation, log_so3(is_from_true.rotation);
    const Eigen::Matrix3d position_P = P.topLeftCorner<3, 3>();
    run.position_nees.push_back(e.head<3>().dot(position_P.inverse() * e.head<3>()) / 3.0);
    run.pose_nees.push_back(e.dot(P.inverse() * e) / 6.0);
    run.error_m = e.head<3>().norm();
    run.sigma_m = std::sqrt(position_P.trace());
  }

  DeskWalk walk_;
  Draws draws_;
  Camera camera_;
  std::vector<Rigid3> path_;
  std::vector<KnownPoint> known_;
  std::vector<Eigen::Vector3d> points_;
  std::optional<FilterBank> bank_;
  std::map<long, std::size_t> last_seen_;
  std::size_t frame_ = 0;
};

}  // namespace alidade::testing
