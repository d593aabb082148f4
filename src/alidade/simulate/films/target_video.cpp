#include "alidade/simulate/films/target_video.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>
#include <opencv2/imgproc.hpp>

#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

/// Clouds: a few waves over the directions, 60 to 160 of 255.
double clouds(const Eigen::Vector3d& direction_in_world) {
  const Eigen::Vector3d& d = direction_in_world;
  const double waves = std::sin(9.0 * d.x() + 4.0 * d.y()) + std::sin(13.0 * d.y() - 5.0 * d.z() + 1.0) +
                       std::sin(17.0 * d.z() + 11.0 * d.x() + 2.0);
  return 110.0 + 50.0 / 3.0 * waves;
}

/// Coloured patches: of each colour eight waves of 40 to 160 per radian in directions of their own, σ 1 together.
class Patches {
 public:
  Patches() {
    Draws draws(41);
    for (auto& colour : waves_)
      for (Wave& wave : colour)
        wave = {draws.uniform(40.0, 160.0) * draws.normal3().normalized(), draws.uniform(0.0, 2.0 * std::numbers::pi)};
  }
  [[nodiscard]] cv::Vec3f at(const Eigen::Vector3d& direction_in_world) const {
    cv::Vec3f value;
    for (int c = 0; c < 3; ++c) {
      double sum = 0.0;
      for (const Wave& wave : waves_[static_cast<std::size_t>(c)])
        sum += std::sin(wave.per_rad.dot(direction_in_world) + wave.phase_rad);
      value[c] = static_cast<float>(sum / std::sqrt(0.5 * num_waves));
    }
    return value;
  }

 private:
  static constexpr std::size_t num_waves = 8;
  struct Wave {
    Eigen::Vector3d per_rad;
    double phase_rad = 0.0;
  };
  std::array<std::array<Wave, num_waves>, 3> waves_;
};

struct TargetView {
  Rigid3 world_from_cam;
  const FilmedTarget& target;
  Eigen::Vector3d centre_in_world;
};

/// Colour (BGR) of the target along a ray of the world, or none where the ray misses it.
std::optional<Eigen::Vector3d> seen_of_target(const TargetView& view, const Eigen::Vector3d& direction) {
  const Eigen::Vector3d to_centre = view.centre_in_world - view.world_from_cam.translation;
  if (view.target.card == nullptr) {
    const double along = to_centre.dot(direction);
    const double off_m2 = to_centre.squaredNorm() - along * along;
    if (along <= 0.0 || off_m2 > view.target.radius_m * view.target.radius_m) return std::nullopt;
    return view.target.rgb.reverse();
  }
  const double ahead = to_centre.z() / direction.z();  // its plane is square to z
  if (!(ahead > 0.0)) return std::nullopt;
  const Eigen::Vector2d at = (ahead * direction - to_centre).head<2>() / (2.0 * view.target.radius_m);
  if (at.cwiseAbs().maxCoeff() >= 0.5) return std::nullopt;
  const cv::Mat& card = *view.target.card;
  const int u = std::clamp(static_cast<int>((at.x() + 0.5) * card.cols), 0, card.cols - 1);
  const int v = std::clamp(static_cast<int>((at.y() + 0.5) * card.rows), 0, card.rows - 1);
  return Eigen::Vector3d::Constant(card.at<unsigned char>(v, u));
}

/// Rays of the pixel and of the 3 × 3 points in it.
void paint_target(const TargetView& view, const Camera& camera, const cv::Rect& window, cv::Mat& image) {
  constexpr int side = 3;
  for (int v = window.y; v < window.br().y; ++v) {
    for (int u = window.x; u < window.br().x; ++u) {
      Eigen::Vector3d sum = Eigen::Vector3d::Zero();
      int hits = 0;
      for (int k = 0; k < side * side; ++k) {
        const Eigen::Vector2d px(u + (k % side - 1) / static_cast<double>(side),
                                 v + (k / side - 1) / static_cast<double>(side));
        const auto ray = unproject(camera, px);
        if (!ray) continue;
        if (const auto seen = seen_of_target(view, view.world_from_cam.rotation * ray->normalized())) {
          sum += *seen;
          ++hits;
        }
      }
      auto& pixel = image.at<cv::Vec3f>(v, u);
      const float behind = static_cast<float>(side * side - hits) / static_cast<float>(side * side);
      for (int c = 0; c < 3; ++c)
        pixel[c] = behind * pixel[c] + static_cast<float>(sum[c]) / static_cast<float>(side * side);
    }
  }
}

/// Pixels that the target can cover.
cv::Rect window_of(const TargetView& view, const Camera& camera) {
  const Rigid3 cam_from_world = view.world_from_cam.inverse();
  const Eigen::Vector3d centre_in_cam = cam_from_world * view.centre_in_world;
  const auto px = project(camera, centre_in_cam);
  if (!px) return {};
  const double f_px = params(camera.lens).head<2>().maxCoeff();
  const double reach = 2.5 * f_px * view.target.radius_m / centre_in_cam.z() + 4.0;
  const cv::Rect2d box(px->x() - reach, px->y() - reach, 2.0 * reach, 2.0 * reach);
  return cv::Rect(box & cv::Rect2d(0.0, 0.0, camera.width_px, camera.height_px));
}

cv::Mat painted_clouds(const Camera& camera, const Rigid3& world_from_cam, double clutter) {
  static const Patches patches;
  cv::Mat image(camera.height_px, camera.width_px, CV_32FC3);
  for (int v = 0; v < image.rows; ++v) {
    for (int u = 0; u < image.cols; ++u) {
      const auto ray = unproject(camera, Eigen::Vector2d(u, v));
      auto& pixel = image.at<cv::Vec3f>(v, u);
      pixel = cv::Vec3f::all(0.0F);
      if (!ray) continue;
      const Eigen::Vector3d direction = world_from_cam.rotation * ray->normalized();
      pixel = cv::Vec3f::all(static_cast<float>(clouds(direction)));
      if (clutter > 0.0) pixel += static_cast<float>(clutter) * patches.at(direction);
    }
  }
  return image;
}

}  // namespace

cv::Mat render_target_frame(const RigHead& rig_head, const Eigen::Vector2d& pan_tilt_rad,
                            const std::optional<Eigen::Vector3d>& target_in_world, const FilmedTarget& target,
                            const TargetVideoConfig& config, std::uint64_t seed) {
  const Camera& camera = rig_head.camera;
  const Rigid3 pose = world_from_cam(rig_head.head, pan_tilt_rad);
  cv::Mat image = painted_clouds(camera, pose, config.clutter);
  if (target_in_world) {
    const TargetView view{pose, target, *target_in_world};
    paint_target(view, camera, window_of(view, camera), image);
  }
  if (config.blur_px > 0.0) cv::GaussianBlur(image, image, {}, config.blur_px);
  Draws draws(seed);
  for (int v = 0; v < image.rows; ++v) {
    auto* row = image.ptr<float>(v);
    for (int i = 0; i < 3 * image.cols; ++i) row[i] += static_cast<float>(config.noise * draws.normal());
  }
  cv::Mat frame;
  image.convertTo(frame, CV_8UC3);
  return frame;
}

}  // namespace alidade
