#include "alidade/simulate/boards/board_light.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "alidade/simulate/draws.h"

namespace alidade {

struct LocalPlace {
  Eigen::Vector2d centre, du, dv, duu, duv, dvv;

  LocalPlace(const std::vector<Eigen::Vector2d>& above, const std::vector<Eigen::Vector2d>& here,
             const std::vector<Eigen::Vector2d>& below, std::size_t i)
      : centre(here[i]),
        du(0.5 * (here[i + 1] - here[i - 1])),
        dv(0.5 * (below[i] - above[i])),
        duu(here[i + 1] - 2.0 * here[i] + here[i - 1]),
        duv(0.25 * (below[i + 1] - below[i - 1] - above[i + 1] + above[i - 1])),
        dvv(below[i] - 2.0 * here[i] + above[i]) {}

  [[nodiscard]] bool is_known() const { return du.allFinite() && dv.allFinite() && duv.allFinite(); }
  [[nodiscard]] Eigen::Vector2d at(double u, double v) const {
    return centre + u * du + v * dv + (0.5 * u * u) * duu + (u * v) * duv + (0.5 * v * v) * dvv;
  }
  [[nodiscard]] Eigen::Vector2d reach() const {
    return 0.8 * (du.cwiseAbs() + dv.cwiseAbs()) + duu.cwiseAbs() + dvv.cwiseAbs() + duv.cwiseAbs();
  }
  /// Width of the ramp of an edge that has the variance of a box of 1/n pixel.
  [[nodiscard]] Eigen::Vector2d ramp(int n) const { return (du.cwiseAbs2() + dv.cwiseAbs2()).cwiseSqrt() / n; }
};

BlurKernel::BlurKernel(double blur_px, int oversampling)
    : reach(static_cast<int>(std::ceil(4.5 * blur_px)) + (blur_px > 0.0)) {
  const int n = (2 * reach + 1) * oversampling;
  Eigen::VectorXd unscaled = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < n; ++i) {
    const double offset_px = (i + 0.5) / oversampling - reach - 0.5;
    for (int k = 0; k < oversampling; ++k) {
      const double z = offset_px - ((k + 0.5) / oversampling - 0.5);
      if (blur_px > 0.0) unscaled[i] += std::exp(-0.5 * z * z / (blur_px * blur_px));
      if (!(blur_px > 0.0) && std::abs(z) < 1e-9) unscaled[i] += 1.0;
    }
  }
  weights = (unscaled / unscaled.sum()).cast<float>();
}

WavyBackground::WavyBackground(int width, int height, int margin, double texture, std::uint64_t seed)
    : margin_(margin), across_(num_waves, width + 2 * margin), down_(num_waves, height + 2 * margin) {
  Draws draws(seed);
  for (int wave = 0; wave < num_waves; ++wave) {
    for (Eigen::MatrixXd* factor : {&across_, &down_}) {
      const double per_px = draws.uniform(0.01, 0.12), phase = draws.uniform(0.0, 6.28);
      for (Eigen::Index i = 0; i < factor->cols(); ++i)
        (*factor)(wave, i) = std::sin(per_px * static_cast<double>(i) + phase);
    }
    across_.row(wave) *= texture * draws.uniform(0.03, 0.09);
  }
}

BoardLight::BoardLight(const BoardScene& scene, std::size_t i, const RenderConfig& config, std::uint64_t seed)
    : config_(config),
      width_(scene.camera.width_px),
      height_(scene.camera.height_px),
      kernel_(config.blur_px, config.oversampling),
      pattern_(scene.board),
      rays_(camera_of(scene, i), -kernel_.reach - 1, width_ + kernel_.reach, -kernel_.reach - 1,
            height_ + kernel_.reach),
      surface_(scene.board, scene.points_in_board),
      rotation_(scene.cam_from_board[i].rotation.conjugate().toRotationMatrix()),
      origin_(scene.cam_from_board[i].inverse().translation),
      near_min_(2.0 * pattern_.print_min() - pattern_.print_max()),
      near_max_(2.0 * pattern_.print_max() - pattern_.print_min()),
      background_(width_, height_, kernel_.reach, config.background_texture, seed) {}

/// Point on the board seen by a pixel's centre; NaN where it does not see the board's plane.
Eigen::Vector2d BoardLight::place(int u, int v) const {
  const Eigen::Vector2d none = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  const Eigen::Vector3d ray = rotation_ * rays_.ray(u, v);
  const Eigen::Vector3d origin = origin_ + rotation_ * rays_.origin(u, v);
  const double depth = -origin.z() / ray.z();
  if (!(depth > 0.0)) return none;
  const Eigen::Vector2d flat = origin.head<2>() + depth * ray.head<2>();
  const bool is_near = (flat.array() > near_min_.array()).all() && (flat.array() < near_max_.array()).all();
  if (surface_.is_flat() || !is_near) return flat;
  return surface_.intersect(origin, ray, flat).value_or(none);
}

std::vector<Eigen::Vector2d> BoardLight::place_row(const PixelRect& rect, int v) const {
  std::vector<Eigen::Vector2d> places;
  places.reserve(static_cast<std::size_t>(rect.u_end - rect.u_min + 2 * kernel_.reach + 2));
  for (int u = rect.u_min - kernel_.reach - 1; u <= rect.u_end + kernel_.reach; ++u) places.push_back(place(u, v));
  return places;
}

/// Blurs what `fill` writes into the n × n sub-samples of each pixel, and takes its mean over each pixel of `rect`.
PixelLight BoardLight::integrate(const PixelRect& rect, const Fill& fill) const {
  const int n = config_.oversampling, reach = kernel_.reach;
  const int width = rect.u_end - rect.u_min, height = rect.v_end - rect.v_min, num_rows = height + 2 * reach;
  PixelLight blurred_across(num_rows * n, width), subsamples(n, (width + 2 * reach) * n);
  std::vector<Eigen::Vector2d> above = place_row(rect, rect.v_min - reach - 1);
  std::vector<Eigen::Vector2d> here = place_row(rect, rect.v_min - reach), below;
  for (int row = 0; row < num_rows; ++row) {
    const int v = rect.v_min + row - reach;
    below = place_row(rect, v + 1);
    for (int i = 0; i < width + 2 * reach; ++i) {
      const LocalPlace local(above, here, below, static_cast<std::size_t>(i + 1));
      fill(rect.u_min + i - reach, v, local, subsamples.middleCols(i * n, n));
    }
    for (int k = 0; k < n; ++k)
      for (int u = 0; u < width; ++u)
        blurred_across(row * n + k, u) =
            subsamples.row(k).segment(u * n, kernel_.weights.size()).dot(kernel_.weights.transpose());
    above.swap(here);
    here.swap(below);
  }
  PixelLight light = PixelLight::Zero(height, width);
  for (int v = 0; v < height; ++v)
    for (Eigen::Index k = 0; k < kernel_.weights.size(); ++k)
      light.row(v) += kernel_.weights[k] * blurred_across.row(v * n + k);
  return light;
}

PixelLight BoardLight::ambient() const {
  const int n = config_.oversampling;
  return integrate({0, 0, width_, height_}, [&](int u, int v, const LocalPlace& local, auto block) {
    const double behind = 1.0 - background_(u, v);
    const double lit = 1.0 - config_.gradient * (u + 0.5) / width_;
    if (!local.is_known()) {
      block.setConstant(static_cast<float>(lit * grey(behind)));
    } else if (const auto ink = pattern_.even_ink(local.centre, local.reach(), behind)) {
      block.setConstant(static_cast<float>(lit * grey(*ink)));
    } else {
      for (int k = 0; k < n * n; ++k) {
        const double x = (k % n + 0.5) / n - 0.5, y = (k / n + 0.5) / n - 0.5;
        const double gain = lit - config_.gradient * x / width_;
        block(k / n, k % n) = static_cast<float>(gain * grey(pattern_.ink(local.at(x, y), local.ramp(n), behind)));
      }
    }
  });
}

PixelLight BoardLight::added(const PixelRect& rect, double ink_albedo,
                             const std::function<double(const Eigen::Vector3d& point_in_board)>& on_paper) const {
  const int n = config_.oversampling;
  const double nothing = 1.0 / (1.0 - ink_albedo);  // as much ink as returns no light: what lies beside the board
  return integrate(rect, [&](int, int, const LocalPlace& local, auto block) {
    block.setZero();
    if (!local.is_known()) return;
    for (int k = 0; k < n * n; ++k) {
      const Eigen::Vector2d at = local.at((k % n + 0.5) / n - 0.5, (k / n + 0.5) / n - 0.5);
      const double albedo = 1.0 - (1.0 - ink_albedo) * pattern_.ink(at, local.ramp(n), nothing);
      block(k / n, k % n) = static_cast<float>(albedo * on_paper(surface_.point(at)));
    }
  });
}

}  // namespace alidade
