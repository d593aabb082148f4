#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <span>

namespace cv {
class Mat;
}

namespace alidade {

/// Predicted appearance of a patch: grey values about their mean, and their derivatives by a shift.
struct PatchView {
  static constexpr int half_px = 5, side_px = 2 * half_px + 1, area_px = side_px * side_px;
  static constexpr int row_px = 16;                               ///< Rows are zero-padded: sixteen products at a time.
  alignas(32) std::array<std::int16_t, side_px * row_px> grey{};  ///< Mean removed.
  std::array<float, area_px> shade{};                             ///< The same, not rounded.
  std::array<float, area_px> along_u{}, along_v{};                ///< Derivatives, orthogonal to gain and bias.
  Eigen::Matrix2d shift_information = Eigen::Matrix2d::Zero();    ///< Σ of their products.
  double energy = 0.0;                                            ///< Σ shade².
};

/// The surroundings of a point as first seen, to be located from other viewpoints. AnchorPatch locates a patch to a few
/// hundredths of a pixel, and estimates its warp; this class takes the warp from the predicted camera pose, at a
/// hundredth of the cost.
class ReferencePatch {
 public:
  static constexpr int half_px = 12;         ///< Larger than a view, which may be rotated and scaled.
  static constexpr int margin_px = half_px;  ///< Pixels required around it in the image.
  static constexpr int side_px = 2 * half_px + 1;
  static constexpr std::size_t area_px = static_cast<std::size_t>(side_px) * side_px;

  ReferencePatch() = default;
  /// Cuts it out of an 8-bit image of one channel, `margin_px` inside.
  ReferencePatch(const cv::Mat& grey, int u, int v);
  /// From the values that grey() returned.
  explicit ReferencePatch(std::span<const std::uint8_t, area_px> grey);

  [[nodiscard]] std::span<const std::uint8_t, area_px> grey() const { return grey_; }  ///< Row by row.
  /// Its appearance under a linear map of offsets from its centre, first image to current one. Empty: scaled too much
  /// or mirrored by it, or without texture.
  [[nodiscard]] std::optional<PatchView> seen_through(const Eigen::Matrix2d& here_from_first) const;

 private:
  std::array<std::uint8_t, area_px> grey_{};
};

struct PatchSearch {
  double num_sigma = 3.0;        ///< Size of the ellipse.
  double min_correlation = 0.8;  ///< Normalised, with the predicted appearance.
  double max_half_px = 40.0;     ///< Limit of the ellipse's half-axes.
};

/// A located patch.
struct PatchMatch {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Of its centre.
  double correlation = 0.0;
  double sigma_px = 0.0;  ///< Of a coordinate, from the residuals of the fit.
  int num_compared = 0;   ///< Positions evaluated.
};

/// Searches every pixel of the ellipse (px − expected)ᵀ S⁻¹ (px − expected) ≤ num_sigma² by normalised
/// cross-correlation, then refines to subpixels by least squares of shift, gain and bias (S. Baker & I. Matthews,
/// "Lucas–Kanade 20 years on", 2004: inverse-compositional). A. J. Davison, "Active Search for Real-Time Vision", ICCV
/// 2005. Smooth the image with smoothed_for_search() first, as that of the patch was.
[[nodiscard]] std::optional<PatchMatch> find_patch(const cv::Mat& smoothed, const PatchView& view,
                                                   const Eigen::Vector2d& expected_px, const Eigen::Matrix2d& S,
                                                   const PatchSearch& search = {});

/// The image in 8 bits, smoothed by [1 2 1]/4 along rows and columns.
[[nodiscard]] cv::Mat smoothed_for_search(const cv::Mat& grey);

}  // namespace alidade
