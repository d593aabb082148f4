#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/patches/image_warp.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A patch's position in an image, and its warp since it was cut out: a point at offset d from its
/// centre is seen at px + linear d + ½ bend (d_x², 2 d_x d_y, d_y²), with grey values gain · grey +
/// bias.
struct PatchPose {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d linear = Eigen::Matrix2d::Identity();
  WarpBend bend = WarpBend::Zero();  ///< Given, not estimated: a patch hardly separates curvature from position.
  double gain = 1.0, bias = 0.0;
};

/// Result of aligning a patch.
struct PatchFit {
  PatchPose pose;
  double rms = 0.0;  ///< Of the residuals, in grey values of the patch.
  bool converged = false;
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< Of px, from the noise of this frame only. [px²]
};

/// A square patch of one image that is located in others by an affine warp with gain and bias, to a few hundredths of a
/// pixel: inverse-compositional Gauss–Newton, whose derivatives are those of the patch and are computed once. S. Baker
/// & I. Matthews, "Lucas–Kanade 20 years on", 2004.
///
/// Images are 32-bit float, smoothed by smoothed_for_patches(): then interpolation causes hardly any error that depends
/// on the subpixel position.
class AnchorPatch {
 public:
  static constexpr int half_px = 7;
  /// Pixels required around `px` in the image.
  static constexpr int margin_px = half_px + 3;

  AnchorPatch() = default;
  /// Cuts out the patch around a whole pixel, `margin_px` inside the image.
  AnchorPatch(const cv::Mat& smoothed, int u, int v);

  /// Locates it from a pose that is off by about 2 px at most. Not converged: it is not there, or partly outside.
  [[nodiscard]] PatchFit align(const cv::Mat& smoothed, const PatchPose& start) const;

  /// Covariance of the position [px²] for noise of σ = 1 grey value in the unsmoothed image.
  [[nodiscard]] const Eigen::Matrix2d& cov_of_unit_noise() const { return cov_unit_; }
  /// σ of the patch's own grey values.
  [[nodiscard]] double contrast() const { return contrast_; }
  /// RMS of residuals between two smoothed images for noise of σ = 1 in each.
  [[nodiscard]] double rms_of_unit_noise() const { return rms_unit_; }

 private:
  static constexpr int side_px = 2 * half_px + 1, area_px = side_px * side_px;
  static constexpr int num_unknowns = 8;  // position, linear part, gain, bias
  using Jacobian = Eigen::Matrix<float, num_unknowns, Eigen::Dynamic>;

  void set_noise_model();

  std::vector<float> grey_;
  Jacobian jacobian_;
  Eigen::Matrix<double, num_unknowns, num_unknowns> inverse_ = {};
  Eigen::Matrix2d cov_unit_ = Eigen::Matrix2d::Zero();
  double contrast_ = 0.0, rms_unit_ = 1.0;
};

/// The image in 32-bit float, smoothed by [1 2 1]/4 along rows and columns.
[[nodiscard]] cv::Mat smoothed_for_patches(const cv::Mat& grey);

}  // namespace alidade
