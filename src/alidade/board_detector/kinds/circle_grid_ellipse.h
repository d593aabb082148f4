#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

namespace cv {
class Mat;
}

namespace alidade {

/// An ellipse in a photo: points p with (p − px)ᵀ A (p − px) = 1.
struct Ellipse {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d A = Eigen::Matrix2d::Identity();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< Covariance of the centre [px²].
  double contrast = 0.0;                              ///< Inside minus outside, in grey values.

  [[nodiscard]] double area() const;
};

/// Fits a blurred disc, I(p) = b + c · Φ(−d(p)/s) with d the distance [px] from the ellipse, to the pixels of a square
/// around `start`: 8 parameters (centre, A, blur s, b, c), by Levenberg–Marquardt. The covariance is the inverse normal
/// matrix times the residual variance. None if there is no such disc. `photo` is one channel of 32-bit float.
[[nodiscard]] std::optional<Ellipse> fit_ellipse(const cv::Mat& photo, const Ellipse& start);

/// The conic through the image of a circle, from points on it. None if it is not an ellipse.
[[nodiscard]] std::optional<Ellipse> ellipse_through(std::span<const Eigen::Vector2d> points);

}  // namespace alidade
