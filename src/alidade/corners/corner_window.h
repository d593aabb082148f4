#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <vector>

#include "alidade/corners/corner_fit.h"

namespace alidade {

/// Pixels of one colour so far from both edges that they only depend on the mean and the contrast.
struct FarPixels {
  double count = 0.0, sum = 0.0, sum_of_squares = 0.0;
};

/// The pixels of the parallelogram around a corner. Those near an edge are stored individually, relative to `origin`;
/// their number is a multiple of four (up to three are omitted). The others are only stored as sums.
struct CornerWindow {
  Eigen::Vector2d origin = Eigen::Vector2d::Zero();
  std::vector<float> x, y, grey;
  std::array<FarPixels, 2> far;  ///< [0]: left of one edge and right of the other; [1]: left or right of both.
  double near_px = 0.0;          ///< Pixels closer to an edge than this are stored individually.

  [[nodiscard]] std::size_t num_near() const { return x.size(); }
  [[nodiscard]] double num_pixels() const { return static_cast<double>(x.size()) + far[0].count + far[1].count; }
};

/// `photo` is one channel of 32-bit float.
[[nodiscard]] CornerWindow gather_window(const cv::Mat& photo, const CornerStart& start, const CornerFitConfig& config,
                                         double near_px);

}  // namespace alidade
