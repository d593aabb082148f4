#include <algorithm>
#include <cmath>
#include <limits>
#include <opencv2/core.hpp>
#include <vector>

#include "alidade/simulate/board_photos.h"
#include "alidade/simulate/board_surface.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/printed_pattern.h"
#include "alidade/simulate/ray_table.h"

namespace alidade {
namespace {

using RowMajorF = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Sub-sample weights of one pixel and axis: Gaussian of σ = blur_px, then the pixel's own width. `reach` is the number
/// of pixels before and after it that count.
struct BlurKernel {
  int reach = 0;
  Eigen::VectorXf weights;  ///< (2 reach + 1) · oversampling
};

BlurKernel blur_kernel(double blur_px, int oversampling) {
  BlurKernel kernel;
  kernel.reach = static_cast<int>(std::ceil(4.5 * blur_px)) + (blur_px > 0.0);
  const int n = (2 * kernel.reach + 1) * oversampling;
  Eigen::VectorXd weights = Eigen::VectorXd::Zero(n);
  for (int i = 0; i < n; ++i) {
    const double offset_px = (i + 0.5) / oversampling - kernel.reach - 0.5;
    for (int k = 0; k < oversampling; ++k) {
      const double z = offset_px - ((k + 0.5) / oversampling - 0.5);
      if (blur_px > 0.0) weights[i] += std::exp(-0.5 * z * z / (blur_px * blur_px));
      if (!(blur_px > 0.0) && std::abs(z) < 1e-9) weights[i] += 1.0;
    }
  }
  kernel.weights = (weights / weights.sum()).cast<float>();
  return kernel;
}

/// Smooth background of a few waves, in shares of the way from black to white.
class Background {
 public:
  /// Of pixels −margin … width + margin − 1, and rows alike.
  Background(int width, int height, int margin, double texture, std::uint64_t seed)
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
  [[nodiscard]] double operator()(int u, int v) const {
    return 0.45 + across_.col(u + margin_).dot(down_.col(v + margin_));
  }

 private:
  static constexpr int num_waves = 6;
  int margin_;
  Eigen::MatrixXd across_, down_;
};

/// Board places of the centres of one row of pixels.
class PlaceMap {
 public:
  PlaceMap(const BoardScene& scene, const Rigid3& cam_from_board, const PrintedPattern& pattern, int margin)
      : rays_(scene.camera, -margin - 1, scene.camera.width_px + margin, -margin - 1, scene.camera.height_px + margin),
        surface_(scene.board, scene.points_in_board),
        rotation_(cam_from_board.rotation.conjugate().toRotationMatrix()),
        origin_(cam_from_board.inverse().translation),
        near_min_(2.0 * pattern.print_min() - pattern.print_max()),
        near_max_(2.0 * pattern.print_max() - pattern.print_min()) {}

  /// NaN where the pixel does not see the board's plane.
  [[nodiscard]] Eigen::Vector2d place(int u, int v) const {
    const Eigen::Vector3d ray = rotation_ * rays_.ray(u, v);
    const double depth = -origin_.z() / ray.z();
    if (!(depth > 0.0)) return none;
    const Eigen::Vector2d flat = origin_.head<2>() + depth * ray.head<2>();
    const bool is_near = (flat.array() > near_min_.array()).all() && (flat.array() < near_max_.array()).all();
    if (surface_.is_flat() || !is_near) return flat;
    return surface_.intersect(origin_, ray, flat).value_or(none);
  }

 private:
  const Eigen::Vector2d none = Eigen::Vector2d::Constant(std::numeric_limits<double>::quiet_NaN());
  RayTable rays_;
  BoardSurface surface_;
  Eigen::Matrix3d rotation_;  ///< board_from_cam
  Eigen::Vector3d origin_;    ///< The camera's centre in frame board.
  Eigen::Vector2d near_min_, near_max_;
};

/// Second-order expansion of the place around a pixel's centre, from the eight pixels around it.
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

class Renderer {
 public:
  Renderer(const BoardScene& scene, std::size_t i, const RenderConfig& config, std::uint64_t seed)
      : config_(config),
        width_(scene.camera.width_px),
        height_(scene.camera.height_px),
        kernel_(blur_kernel(config.blur_px, config.oversampling)),
        pattern_(scene.board),
        places_(scene, scene.cam_from_board[i], pattern_, kernel_.reach),
        background_(width_, height_, kernel_.reach, config.background_texture, seed) {}

  /// Light per pixel, before the noise.
  [[nodiscard]] RowMajorF light() {
    const int n = config_.oversampling, reach = kernel_.reach, num_rows = height_ + 2 * reach;
    RowMajorF blurred_across(num_rows * n, width_), subsamples(n, (width_ + 2 * reach) * n);
    std::vector<Eigen::Vector2d> above = place_row(-reach - 1), here = place_row(-reach), below;
    for (int row = 0; row < num_rows; ++row) {
      below = place_row(row - reach + 1);
      fill_row(row - reach, above, here, below, subsamples);
      for (int k = 0; k < n; ++k)
        for (int u = 0; u < width_; ++u)
          blurred_across(row * n + k, u) =
              subsamples.row(k).segment(u * n, kernel_.weights.size()).dot(kernel_.weights.transpose());
      above.swap(here);
      here.swap(below);
    }
    RowMajorF light = RowMajorF::Zero(height_, width_);
    for (int v = 0; v < height_; ++v)
      for (Eigen::Index k = 0; k < kernel_.weights.size(); ++k)
        light.row(v) += kernel_.weights[k] * blurred_across.row(v * n + k);
    return light;
  }

 private:
  [[nodiscard]] std::vector<Eigen::Vector2d> place_row(int v) const {
    std::vector<Eigen::Vector2d> places;
    places.reserve(static_cast<std::size_t>(width_ + 2 * kernel_.reach + 2));
    for (int u = -kernel_.reach - 1; u <= width_ + kernel_.reach; ++u) places.push_back(places_.place(u, v));
    return places;
  }

  void fill_row(int v, const std::vector<Eigen::Vector2d>& above, const std::vector<Eigen::Vector2d>& here,
                const std::vector<Eigen::Vector2d>& below, RowMajorF& subsamples) const {
    const int n = config_.oversampling;
    for (int i = 0; i < width_ + 2 * kernel_.reach; ++i) {
      const int u = i - kernel_.reach;
      const LocalPlace local(above, here, below, static_cast<std::size_t>(i + 1));
      auto block = subsamples.middleCols(i * n, n);
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
    }
  }

  [[nodiscard]] double grey(double ink) const { return config_.white + ink * (config_.black - config_.white); }

  RenderConfig config_;
  int width_, height_;
  BlurKernel kernel_;
  PrintedPattern pattern_;
  PlaceMap places_;
  Background background_;
};

}  // namespace

cv::Mat render_board_photo(const BoardScene& scene, std::size_t i, const RenderConfig& config, std::uint64_t seed) {
  const RowMajorF light = Renderer(scene, i, config, seed).light();
  Draws draws(seed + 0x9e3779b97f4a7c15u * (i + 1));
  cv::Mat photo(scene.camera.height_px, scene.camera.width_px, CV_8U);
  for (int v = 0; v < photo.rows; ++v) {
    auto* row = photo.ptr<unsigned char>(v);
    for (int u = 0; u < photo.cols; ++u) {
      const double noisy =
          static_cast<double>(light(v, u)) + (config.noise > 0.0 ? config.noise * draws.normal() : 0.0);
      row[u] = static_cast<unsigned char>(std::lround(std::clamp(noisy, 0.0, 255.0)));
    }
  }
  return photo;
}

}  // namespace alidade
