#pragma once

#include <Eigen/Core>
#include <string_view>

namespace cv {
class Mat;
}

namespace alidade {

/// Predicted position of a chessboard corner, and the grid around it: in units of these two vectors its neighbours are
/// at (±1, 0), (0, ±1). `bend`: curvature of the edge along that vector [1/px], positive towards the left normal.
struct CornerStart {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Vector2d along_cols = {20.0, 0.0};
  Eigen::Vector2d along_rows = {0.0, 20.0};
  double bend_cols = 0.0, bend_rows = 0.0;
  double blur_px = 1.0;  ///< Initial guess of the blur.
};

struct CornerFitConfig {
  double window = 0.47;  ///< Half side of the fitted parallelogram, in squares; below 0.5 no pixel serves two corners.
  double max_half_window_px = 24;  ///< Above it the edges contain more of the lens's curvature than of the corner.
  double max_move_px = 2.0;        ///< A fit that moves further from its initial guess has found something else.
  double min_contrast = 2.0;       ///< Half the step between black and white, in grey values.
  double max_misfit = 0.30;        ///< Residual RMS over the contrast: above it, glare, occlusion or another pattern.
  int max_iterations = 12;         ///< 3–5 are typical.
};

/// A corner with subpixel accuracy and its covariance: inverse normal matrix times the residual variance.
struct CornerFit {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< [px²]
  double blur_px = 0.0;
  double contrast =
      0.0;           ///< Signed half step: positive where the quadrant between +along_cols and +along_rows is bright.
  double rms = 0.0;  ///< Residual RMS, in grey values.
  std::string_view reason;  ///< Why there is no corner; empty if there is one.
  [[nodiscard]] bool accepted() const { return reason.empty(); }
};

/// Fits two blurred straight edges through one point to the pixels around a corner of a chessboard,
///     I(u, v) = b + c · erf(d₁ / (√2 s)) · erf(d₂ / (√2 s)),
/// with d₁, d₂ the signed distances [px] to the edges: 7 parameters (position, two directions, blur s, b, c), by
/// Levenberg–Marquardt with analytic derivatives. No window size has to be chosen: the parallelogram follows the grid,
/// so that the fit also works under strong tilt. `photo` is one channel of 32-bit float, 0 to 255.
[[nodiscard]] CornerFit fit_corner(const cv::Mat& photo, const CornerStart& start, const CornerFitConfig& config = {});

}  // namespace alidade
