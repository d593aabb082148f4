#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <functional>
#include <vector>

#include "alidade/simulate/boards/board_photos.h"
#include "alidade/simulate/boards/board_surface.h"
#include "alidade/simulate/boards/printed_pattern.h"
#include "alidade/simulate/boards/ray_table.h"

namespace alidade {

/// Light of pixels in grey values, before noise and rounding: rows v, columns u.
using PixelLight = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Pixels u_min ≤ u < u_end, v_min ≤ v < v_end.
struct PixelRect {
  int u_min = 0, v_min = 0, u_end = 0, v_end = 0;
  [[nodiscard]] bool is_empty() const { return u_end <= u_min || v_end <= v_min; }
};

/// Sub-sample weights of one pixel along one axis: a Gaussian of σ = blur_px, then the pixel's own width. `reach` is
/// the number of pixels before and after it that contribute.
struct BlurKernel {
  int reach = 0;
  Eigen::VectorXf weights;  ///< (2 reach + 1) · oversampling

  BlurKernel(double blur_px, int oversampling);
};

/// Smooth background of a few waves, as fractions of the range from black to white.
class WavyBackground {
 public:
  /// Covers pixels −margin … width + margin − 1, and rows likewise.
  WavyBackground(int width, int height, int margin, double texture, std::uint64_t seed);
  [[nodiscard]] double operator()(int u, int v) const {
    return 0.45 + across_.col(u + margin_).dot(down_.col(v + margin_));
  }

 private:
  static constexpr int num_waves = 6;
  int margin_;
  Eigen::MatrixXd across_, down_;
};

/// Second-order expansion of the point on the board around a pixel's centre, from the eight pixels around it.
struct LocalPlace;

/// The light of photo `i` of a scene, by casting rays through the lens on the (curved) board: the print's light,
/// blurred by the optics, integrated over each pixel. Light is linear: that of a lamp is computed separately and added.
class BoardLight {
 public:
  /// `seed` determines the background.
  BoardLight(const BoardScene& scene, std::size_t i, const RenderConfig& config, std::uint64_t seed);

  /// The whole image in ambient light.
  [[nodiscard]] PixelLight ambient() const;

  /// Light added by a lamp in the pixels of `rect`. `on_paper`: the grey value that it gives white paper at a point in
  /// frame board. Ink returns `ink_albedo` of what paper returns; everything beside the board returns nothing.
  [[nodiscard]] PixelLight added(const PixelRect& rect, double ink_albedo,
                                 const std::function<double(const Eigen::Vector3d& point_in_board)>& on_paper) const;

  /// Number of pixels before and after a point of light that its blur reaches.
  [[nodiscard]] int blur_reach() const { return kernel_.reach; }

 private:
  using Fill =
      std::function<void(int u, int v, const LocalPlace& local, Eigen::Ref<PixelLight, 0, Eigen::OuterStride<>>)>;
  [[nodiscard]] PixelLight integrate(const PixelRect& rect, const Fill& fill) const;
  [[nodiscard]] Eigen::Vector2d place(int u, int v) const;
  [[nodiscard]] std::vector<Eigen::Vector2d> place_row(const PixelRect& rect, int v) const;
  [[nodiscard]] double grey(double ink) const { return config_.white + ink * (config_.black - config_.white); }

  RenderConfig config_;
  int width_, height_;
  BlurKernel kernel_;
  PrintedPattern pattern_;
  RayTable rays_;
  BoardSurface surface_;
  Eigen::Matrix3d rotation_;  ///< board_from_cam
  Eigen::Vector3d origin_;    ///< The camera's centre in frame board.
  Eigen::Vector2d near_min_, near_max_;
  WavyBackground background_;
};

}  // namespace alidade
