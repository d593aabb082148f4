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

/// What a patch should look like now: grey values about their mean, and what a shift would change.
struct PatchView {
  static constexpr int half_px = 5, side_px = 2 * half_px + 1, area_px = side_px * side_px;
  static constexpr int row_px = 16;  ///< Rows are padded by zeros: sixteen products at a time.
  alignas(32) std::array<std::int16_t, side_px * row_px> grey{};  ///< Without their mean.
  std::array<float, area_px> shade{};                             ///< The same, exact.
  std::array<float, area_px> along_u{}, along_v{};              ///< Derivatives, without their share of gain and bias.
  Eigen::Matrix2d shift_information = Eigen::Matrix2d::Zero();  ///< Σ of their products.
  double energy = 0.0;                                          ///< Σ shade².
};

/// The surroundings of a point as they were first seen, to be found again from elsewhere. AnchorPatch finds a patch to
/// a few hundredths of a pixel, and its warp with it; this one takes the warp from where the camera is thought to be,
/// and costs a hundredth of it.
class ReferencePatch {
 public:
  static constexpr int half_px = 12;         ///< More than a view needs: it may be seen rotated and larger.
  static constexpr int margin_px = half_px;  ///< Pixels around that have to be in the image.
  static constexpr int side_px = 2 * half_px + 1;
  static constexpr std::size_t area_px = static_cast<std::size_t>(side_px) * side_px;

  ReferencePatch() = default;
  /// Cuts it out of an 8-bit image of one channel, `margin_px` inside.
  ReferencePatch(const cv::Mat& grey, int u, int v);
  /// Of what grey() gave.
  explicit ReferencePatch(std::span<const std::uint8_t, area_px> grey);

  [[nodiscard]] std::span<const std::uint8_t, area_px> grey() const { return grey_; }  ///< Row by row.
  /// As seen through a map of offsets from its centre, first image to this one. None: too small, too large or
  /// mirrored by it, or without texture.
  [[nodiscard]] std::optional<PatchView> seen_through(const Eigen::Matrix2d& here_from_first) const;

 private:
  std::array<std::uint8_t, area_px> grey_{};
};

struct PatchSearch {
  double num_sigma = 3.0;        ///< Size of the ellipse.
  double min_correlation = 0.8;  ///< Normalised, with the patch as it should look.
  double max_half_px = 40.0;     ///< The ellipse is cut off there.
};

/// A patch found.
struct PatchMatch {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Of its centre.
  double correlation = 0.0;
  double sigma_px = 0.0;  ///< Of a coordinate, from what is left over after the fit.
  int num_compared = 0;   ///< Positions evaluated.
};

/// Looks for it at every pixel of the ellipse (px − expected)ᵀ S⁻¹ (px − expected) ≤ num_sigma² by normalised
/// cross-correlation, then between pixels by least squares of shift, gain and bias (S. Baker & I. Matthews,
/// "Lucas–Kanade 20 years on", 2004: inverse-compositional). A. J. Davison, "Active Search for Real-Time Vision", ICCV
/// 2005. Smooth the image with smoothed_for_search() first, as the one of the patch was.
[[nodiscard]] std::optional<PatchMatch> find_patch(const cv::Mat& smoothed, const PatchView& view,
                                                   const Eigen::Vector2d& expected_px, const Eigen::Matrix2d& S,
                                                   const PatchSearch& search = {});

/// The image in 8 bits, smoothed by [1 2 1]/4 along rows and columns.
[[nodiscard]] cv::Mat smoothed_for_search(const cv::Mat& grey);

}  // namespace alidade
