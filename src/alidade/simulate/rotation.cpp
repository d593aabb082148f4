#include "alidade/simulate/rotation.h"

#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotating_lens.h"

namespace alidade {
namespace {

/// The mount's rotation since the start, at times that only grow.
class TrueRotation {
 public:
  TrueRotation(const RotationScene& scene, RotationSource source, double step_s)
      : scene_(scene), is_rate_(source == RotationSource::rate), step_s_(step_s) {}

  /// mount_from_start at t ≥ 0 (and, for a small negative t, extrapolated).
  Eigen::Quaterniond at(double t_s) {
    if (!is_rate_) return base_from_cam(t_s).conjugate() * base_from_cam(0.0);
    while (t_s_ + step_s_ <= t_s) advance(step_s_);
    return exp_so3(-scene_.motion(0.5 * (t_s_ + t_s)) * (t_s - t_s_)) * mount_from_start_;
  }

 private:
  [[nodiscard]] Eigen::Quaterniond base_from_cam(double t_s) const {
    return base_from_cam_rotation(scene_.motion(t_s), scene_.axes_skew_rad);
  }
  void advance(double h) {
    mount_from_start_ = (exp_so3(-scene_.motion(t_s_ + 0.5 * h) * h) * mount_from_start_).normalized();
    t_s_ += h;
  }

  const RotationScene& scene_;
  bool is_rate_;
  double step_s_;
  double t_s_ = 0.0;
  Eigen::Quaterniond mount_from_start_ = Eigen::Quaterniond::Identity();
};

/// Points at the start, in the camera frame; those without a depth stand a million metres away.
std::vector<Eigen::Vector3d> world_of(const RotationScene& scene) {
  std::vector<Eigen::Vector3d> points;
  for (std::size_t i = 0; i < scene.start_px.size(); ++i) {
    const double depth_m = scene.depth_m.empty() ? 1e6 : scene.depth_m[i];
    points.push_back(depth_m * ray_of_px(scene.intrinsics(0.0), scene.start_px[i]));
  }
  return points;
}

void measure_rotation(const RotationScene& scene, const RotationLogConfig& config, Draws& draws, RotationRow& row) {
  const Eigen::Vector3d motion = scene.motion(row.t_s);
  if (config.source == RotationSource::rate) {
    row.rate_rad_per_s = motion + config.rate_bias_rad_per_s + config.sigma_rate_rad_per_s * draws.normal3();
  } else if (config.source == RotationSource::head) {
    row.pan_tilt_roll_rad = motion + config.sigma_angle_rad * draws.normal3();
  } else if (config.source == RotationSource::attitude) {
    row.base_from_cam = base_from_cam_rotation(motion) * exp_so3(config.sigma_angle_rad * draws.normal3());
  }
}

/// A world, rotating.
class Turning {
 public:
  Turning(const RotationScene& scene, const RotationLogConfig& config, std::uint64_t seed)
      : scene_(scene),
        config_(config),
        world_(world_of(scene)),
        cam_from_mount_(exp_so3(scene.mount_rad)),
        mount_(scene, config.source, 1.0 / (64.0 * config.rate_hz)),
        draws_(seed) {}

  RotationRow row_at(double t_s, const RotatingIntrinsics& now) {
    RotationRow row;
    row.t_s = t_s;
    measure_rotation(scene_, config_, draws_, row);
    const Eigen::Quaterniond cam_from_start = turned(t_s);
    for (std::size_t i = 0; i < world_.size(); ++i) {
      Eigen::Vector3d point = in_cam(i, cam_from_start);
      if (i == 0 && config_.with_range) row.range_m = point.norm() + config_.sigma_range_m * draws_.normal();
      if (scene_.shutter_s != 0.0) point = at_its_row(i, t_s, now, point);
      row.px.push_back(pixel_of(point, now));
    }
    return row;
  }

 private:
  Eigen::Quaterniond turned(double t_s) {
    return cam_from_mount_ * mount_.at(t_s * (1.0 + scene_.clock_rate) + scene_.delay_s) * cam_from_mount_.conjugate();
  }

  [[nodiscard]] Eigen::Vector3d in_cam(std::size_t i, const Eigen::Quaterniond& cam_from_start) const {
    return cam_from_start * (world_[i] + scene_.lever_arm_m) - scene_.lever_arm_m;
  }

  /// Where the point is when the row that sees it is read.
  Eigen::Vector3d at_its_row(std::size_t i, double t_s, const RotatingIntrinsics& now, Eigen::Vector3d point) {
    constexpr int rounds = 6;  // a row's time moves the point by few rows
    for (int round = 0; round < rounds; ++round) {
      const double v = px_of_ray(now, Eigen::Vector2d(point.head<2>() / point.z())).y();
      const double late_s = scene_.shutter_s * (v - 0.5 * (scene_.height_px - 1.0)) / scene_.height_px;
      point = in_cam(i, turned(t_s + late_s));
    }
    return point;
  }

  Eigen::Vector2d pixel_of(const Eigen::Vector3d& point, const RotatingIntrinsics& now) {
    const Eigen::Vector2d px =
        px_of_ray(now, Eigen::Vector2d(point.head<2>() / point.z())) + config_.sigma_px * draws_.normal2();
    const bool is_inside =
        px.x() >= -0.5 && px.y() >= -0.5 && px.x() < scene_.width_px - 0.5 && px.y() < scene_.height_px - 0.5;
    const bool is_lost = config_.lost_share > 0.0 && draws_.uniform() < config_.lost_share;
    const bool seen = point.z() > 0.0 && (is_inside || !config_.clip_to_image) && !is_lost;
    return seen ? px : Eigen::Vector2d::Constant(not_seen);
  }

  const RotationScene& scene_;
  const RotationLogConfig& config_;
  std::vector<Eigen::Vector3d> world_;
  Eigen::Quaterniond cam_from_mount_;
  TrueRotation mount_;
  Draws draws_;
};

}  // namespace

Eigen::Vector3d paper_rate(double t_s) { return {0.07 * std::sin(0.8 * t_s), 0.12 * std::sin(1.6 * t_s), 0.0}; }

Eigen::Vector3d paper_pan_tilt(double t_s, double mean_tilt_rad) {
  const double pan = -0.075 * (1.0 - std::cos(1.6 * t_s)), tilt = 0.0875 * (1.0 - std::cos(0.8 * t_s));
  return {pan, mean_tilt_rad + tilt, 0.0};
}

std::vector<Eigen::Vector2d> draw_points(int width_px, int height_px, int count, std::uint64_t seed) {
  const double margin_px = std::min(60.0, 0.25 * std::min(width_px, height_px));
  double min_height_px = 40.0;
  Draws draws(seed);
  std::vector<Eigen::Vector2d> points;
  const auto fits = [&](const Eigen::Vector2d& c) {
    for (std::size_t i = 0; i < points.size(); ++i) {
      if ((points[i] - c).norm() < min_height_px) return false;
      for (std::size_t j = 0; j < i; ++j) {
        const Eigen::Vector2d ab = points[j] - points[i], ac = c - points[i], bc = c - points[j];
        const double twice_area = std::abs(ab.x() * ac.y() - ab.y() * ac.x());
        if (twice_area < min_height_px * std::max({ab.norm(), ac.norm(), bc.norm()})) return false;
      }
    }
    return true;
  };
  // With many points no triangle can be asked to be wide.
  const std::size_t demanding = std::min<std::size_t>(static_cast<std::size_t>(count), 6);
  for (int tries = 0; points.size() < static_cast<std::size_t>(count); ++tries) {
    if (tries % 1000 == 999 && points.size() < demanding) {
      points.clear();  // these leave no room for another
      constexpr int enough = 50'000;
      if (tries > enough) min_height_px *= 0.7;  // in a small image there is none
    }
    const double x = draws.uniform(margin_px, width_px - margin_px),
                 y = draws.uniform(margin_px, height_px - margin_px);
    if (points.size() >= demanding || fits({x, y})) points.emplace_back(x, y);
  }
  return points;
}

RotationLog simulate_rotation(const RotationScene& scene, const RotationLogConfig& config, std::uint64_t seed) {
  RotationLog log;
  log.source = config.source;
  log.num_points = scene.start_px.size();
  log.has_roll_rate = config.source == RotationSource::rate;
  if (scene.clock_rate == 0.0) log.sigma_scale = 0.0;
  if (scene.lever_arm_m.isZero(0.0)) log.sigma_parallax = 0.0;
  Turning turning(scene, config, seed);
  const auto num_rows = static_cast<std::size_t>(std::floor(config.duration_s * config.rate_hz + 0.5)) + 1;
  for (std::size_t k = 0; k < num_rows; ++k) {
    const double t_s = static_cast<double>(k) / config.rate_hz;
    const RotatingIntrinsics now = scene.intrinsics(t_s);
    log.rows.push_back(turning.row_at(t_s, now));
    log.truth.push_back({now.fx, now.fy, now.cx, now.cy});
  }
  return log;
}

}  // namespace alidade
