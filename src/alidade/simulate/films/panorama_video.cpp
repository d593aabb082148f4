#include "alidade/simulate/films/panorama_video.h"

#include <tbb/parallel_for.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>
#include <opencv2/core.hpp>

#include "alidade/geometry/so3.h"
#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/rotating_lens.h"

namespace alidade {
namespace {

using RowMajorF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Weights of the sub-samples of a pixel and its neighbours along one axis: the optics' Gaussian over the pixel's box.
struct Kernel {
  int reach = 0;            ///< Pixels before and after that count.
  Eigen::VectorXf weights;  ///< (2 reach + 1) · oversampling
};

Kernel kernel_of(const PanoramaConfig& config) {
  const int n = config.oversampling;
  Kernel kernel;
  kernel.reach = config.blur_px > 0.0 ? static_cast<int>(std::ceil(4.0 * config.blur_px + 0.5)) : 0;
  kernel.weights.resize((2 * kernel.reach + 1) * n);
  const double scale = config.blur_px > 0.0 ? 1.0 / (std::sqrt(2.0) * config.blur_px) : 1e9;
  for (int i = 0; i < static_cast<int>(kernel.weights.size()); ++i) {
    const double at_px = (i + 0.5) / n - kernel.reach - 0.5;
    kernel.weights[i] = static_cast<float>(std::erf((at_px + 0.5) * scale) - std::erf((at_px - 0.5) * scale));
  }
  kernel.weights /= kernel.weights.sum();
  return kernel;
}

/// Directions of pixels. The lens' radial part is inverted once for 4096 radii (tested with the rest to 0.01 px; the
/// table's own error is 1e-6 px), because Newton's steps would cost more than all else. The tangential part, where
/// there is one, is taken off again and again: it changes by a hundredth of the ray, and five rounds leave 1e-8 px.
class View {
 public:
  using RowAttitude = std::function<Eigen::Quaterniond(int row)>;  ///< base_from_cam while a row is read.

  View(const RotatingIntrinsics& k, int width, int height, int margin, const RowAttitude& base_from_cam)
      : k_(k), margin_(margin) {
    for (int row = -margin; row < height + margin; ++row)
      base_from_cam_.push_back(base_from_cam(row).toRotationMatrix().cast<float>());
    constexpr double beyond = 1.2;  // of the farthest corner: the margin that is blurred into the image
    const double x = beyond * std::max(k.cx, width - k.cx) / k.fx, y = beyond * std::max(k.cy, height - k.cy) / k.fy;
    square_step_ = (x * x + y * y) / num_squares;
    is_tangential_ = k.p1 != 0.0 || k.p2 != 0.0;
    RotatingIntrinsics radial = k;
    radial.p1 = radial.p2 = 0.0;
    const bool is_radial = k.k1 != 0.0 || k.k2 != 0.0 || k.k3 != 0.0;
    for (int i = 0; is_radial && i < num_squares + 2; ++i) {
      const double bent = std::sqrt((i + 1e-9) * square_step_);  // at the centre the scale is the limit's
      scale_.push_back(static_cast<float>(ray_of_px(radial, {k.cx + k.fx * bent, k.cy}).x() / bent));
    }
  }

  [[nodiscard]] Eigen::Vector3f direction(double u, double v) const {
    const auto x = static_cast<float>((u - k_.cx) / k_.fx), y = static_cast<float>((v - k_.cy) / k_.fy);
    const Eigen::Vector2f bent(x, y);
    Eigen::Vector2f ray = scale_at(bent.squaredNorm()) * bent;
    for (int i = 0; is_tangential_ && i < 5; ++i) {
      const Eigen::Vector2f radial = bent - tangential(ray);
      ray = scale_at(radial.squaredNorm()) * radial;
    }
    const auto row = std::clamp<std::ptrdiff_t>(std::lround(v) + margin_, 0, std::ssize(base_from_cam_) - 1);
    return base_from_cam_[static_cast<std::size_t>(row)] * Eigen::Vector3f(ray.x(), ray.y(), 1.0f);
  }

 private:
  static constexpr int num_squares = 4096;

  [[nodiscard]] Eigen::Vector2f tangential(const Eigen::Vector2f& ray) const {
    const float x = ray.x(), y = ray.y(), r2 = ray.squaredNorm();
    const auto p1 = static_cast<float>(k_.p1), p2 = static_cast<float>(k_.p2);
    return {2.0f * p1 * x * y + p2 * (r2 + 2.0f * x * x), p1 * (r2 + 2.0f * y * y) + 2.0f * p2 * x * y};
  }

  [[nodiscard]] float scale_at(float bent_squared) const {
    if (scale_.empty()) return 1.0f;
    const float at = bent_squared / static_cast<float>(square_step_);
    const std::size_t i = std::min(static_cast<std::size_t>(at), static_cast<std::size_t>(num_squares));
    return scale_[i] + (at - static_cast<float>(i)) * (scale_[i + 1] - scale_[i]);
  }

  RotatingIntrinsics k_;
  int margin_;
  std::vector<Eigen::Matrix3f> base_from_cam_;  ///< Of each row, from the margin above.
  double square_step_ = 1.0;
  bool is_tangential_ = false;
  std::vector<float> scale_;  ///< Undistorted over distorted radius, by even steps of the square of the latter.
};

/// Things that move: discs of the far world that rotate about the camera, each its own way, with what is on them.
class MovingDiscs {
 public:
  MovingDiscs() = default;
  /// A share of the sphere, as it is at a time; those that a view along `axis` may see.
  MovingDiscs(double share, double focal_px, double t_s, const Eigen::Vector3f& axis, std::uint64_t seed) {
    constexpr double radius_px = 40.0, fastest_px_per_s = 20.0, half_view_rad = 1.0;
    const double radius_rad = radius_px / focal_px, area = std::numbers::pi * radius_rad * radius_rad;
    const int num = static_cast<int>(-std::log1p(-std::min(share, 0.99)) * 4.0 * std::numbers::pi / area);
    cos_radius_ = static_cast<float>(std::cos(radius_rad));
    Draws draws(seed);
    for (int i = 0; i < num; ++i) {
      const Eigen::Vector3d at = Eigen::Vector3d(draws.normal(), draws.normal(), draws.normal()).normalized();
      const Eigen::Vector3d across = at.cross(Eigen::Vector3d(draws.normal(), draws.normal(), draws.normal()));
      const double rate = draws.uniform(0.2, 1.0) * fastest_px_per_s / focal_px;
      const Eigen::Matrix3f moved = exp_so3(rate * t_s * across.normalized()).toRotationMatrix().cast<float>();
      const Eigen::Vector3f now = moved * at.cast<float>();
      if (now.dot(axis) > std::cos(half_view_rad)) discs_.push_back({now, moved.transpose()});
    }
  }

  /// Where the light from a direction was while nothing had moved.
  [[nodiscard]] Eigen::Vector3f origin(const Eigen::Vector3f& direction) const {
    const float limit = cos_radius_ * (discs_.empty() ? 0.0F : direction.norm());
    for (const Disc& disc : discs_)
      if (disc.at.dot(direction) > limit) return disc.back * direction;
    return direction;
  }

 private:
  struct Disc {
    Eigen::Vector3f at;
    Eigen::Matrix3f back;
  };
  std::vector<Disc> discs_;
  float cos_radius_ = 1.0F;
};

/// Paints what will be seen: a look at every eighth pixel, and as far around it.
void prepare(FarWorld& world, const View& view, const MovingDiscs& discs, double focal_px, int width, int height,
             int margin) {
  constexpr int step_px = 8;
  std::vector<Eigen::Vector3f> directions;
  for (int v = -margin; v < height + margin + step_px; v += step_px)
    for (int u = -margin; u < width + margin + step_px; u += step_px) {
      directions.push_back(view.direction(u, v));
      const Eigen::Vector3f origin = discs.origin(directions.back());
      if (origin != directions.back()) directions.push_back(origin);
    }
  world.prepare(directions, step_px / focal_px);
}

/// Light per pixel, before the noise.
RowMajorF light_of(const FarWorld& world, const View& view, const MovingDiscs& discs, int width, int height,
                   const PanoramaConfig& config) {
  const int n = config.oversampling;
  const Kernel kernel = kernel_of(config);
  const int cols = (width + 2 * kernel.reach) * n, rows = (height + 2 * kernel.reach) * n;
  RowMajorF across(rows, width), light(height, width);
  tbb::parallel_for(0, rows, [&](int row) {
    Eigen::VectorXf samples(cols);
    const double v = (row + 0.5) / n - kernel.reach - 0.5;
    for (int i = 0; i < cols; ++i)
      samples[i] = world.grey(discs.origin(view.direction((i + 0.5) / n - kernel.reach - 0.5, v)));
    for (int u = 0; u < width; ++u) across(row, u) = samples.segment(u * n, kernel.weights.size()).dot(kernel.weights);
  });
  tbb::parallel_for(0, height, [&](int v) {
    light.row(v).noalias() = kernel.weights.transpose() * across.middleRows(v * n, kernel.weights.size());
  });
  return light;
}

cv::Mat render(FarWorld& world, const RotatingIntrinsics& intrinsics, int width_px, int height_px,
               const View::RowAttitude& base_from_cam, const MovingDiscs& discs, const PanoramaConfig& config,
               std::uint64_t seed) {
  const int margin = kernel_of(config).reach + 1;
  const View view(intrinsics, width_px, height_px, margin, base_from_cam);
  prepare(world, view, discs, std::min(intrinsics.fx, intrinsics.fy), width_px, height_px, margin);
  const RowMajorF light = light_of(world, view, discs, width_px, height_px, config);
  Draws draws(seed);
  cv::Mat frame(height_px, width_px, CV_8U);
  for (int v = 0; v < height_px; ++v) {
    auto* row = frame.ptr<unsigned char>(v);
    for (int u = 0; u < width_px; ++u) {
      const double noise = config.noise > 0.0 ? config.noise * draws.normal() : 0.0;
      row[u] =
          static_cast<unsigned char>(std::lround(std::clamp(static_cast<double>(light(v, u)) + noise, 0.0, 255.0)));
    }
  }
  return frame;
}

}  // namespace

cv::Mat render_panorama(FarWorld& world, const RotatingIntrinsics& intrinsics, int width_px, int height_px,
                        const Eigen::Quaterniond& base_from_cam, const PanoramaConfig& config, std::uint64_t seed) {
  return render(
      world, intrinsics, width_px, height_px, [&](int) { return base_from_cam; }, {}, config, seed);
}

Eigen::Quaterniond true_base_from_cam(const RotationScene& scene, double t_s) {
  const Eigen::Quaterniond cam_from_mount = exp_so3(scene.mount_rad);
  const Eigen::Quaterniond base_from_mount = base_from_cam_rotation(scene.motion(t_s));
  return base_from_mount * cam_from_mount.conjugate();
}

cv::Mat render_panorama_frame(FarWorld& world, const RotationScene& scene, std::size_t k, double rate_hz,
                              const PanoramaConfig& config, std::uint64_t seed) {
  const double t_s = static_cast<double>(k) / rate_hz;
  const RotatingIntrinsics intrinsics = scene.intrinsics(t_s);
  const auto at_row = [&](int row) {
    const double late_s = scene.shutter_s * (row - 0.5 * (scene.height_px - 1.0)) / scene.height_px;
    return true_base_from_cam(scene, (t_s + late_s) * (1.0 + scene.clock_rate) + scene.delay_s);
  };
  MovingDiscs discs;
  if (config.moving_share > 0.0) {
    const Eigen::Vector3d axis =
        true_base_from_cam(scene, t_s * (1.0 + scene.clock_rate) + scene.delay_s) * Eigen::Vector3d::UnitZ();
    discs = MovingDiscs(config.moving_share, scene.intrinsics(0.0).fx, t_s, axis.cast<float>(), seed + 5);
  }
  return render(world, intrinsics, scene.width_px, scene.height_px, at_row, discs, config,
                seed + 0x9e3779b97f4a7c15u * (k + 1));
}

RotationLog panorama_log(const RotationScene& scene, const RotationLogConfig& config, std::uint64_t seed) {
  RotationScene without_points = scene;
  without_points.start_px.clear();
  without_points.depth_m.clear();
  if (config.source == RotationSource::rate) {
    without_points.motion = [motion = scene.motion](double t_s) {
      constexpr double h = 1e-4;  // of a smooth motion: errors of both kinds are below 1e-8 rad/s
      return head_rate_in_cam(motion(t_s), (motion(t_s + h) - motion(t_s - h)) / (2.0 * h));
    };
  }
  return simulate_rotation(without_points, config, seed);
}

}  // namespace alidade
