#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>

#include "alidade/target/target_detector.h"

namespace alidade {

/// A part of an image: its first pixel and its size.
struct SearchWindow {
  int u = 0, v = 0, width = 0, height = 0;

  [[nodiscard]] Eigen::Vector2d corner() const { return {u, v}; }
};

/// The part of an image in which the target is looked for: 4 σ around where it should be, and `margin_px` more; all of
/// it without an expectation. Of no size: it should be outside.
[[nodiscard]] SearchWindow search_window(const cv::Mat& image, const std::optional<TargetExpectation>& expected,
                                         double margin_px);

[[nodiscard]] TargetDetection lost_target(std::string reason);
[[nodiscard]] std::string two_candidates(const Eigen::Vector2d& a, const Eigen::Vector2d& b);

/// A blob of colour, or one that is brighter or darker than the rest.
[[nodiscard]] TargetDetection find_target_blob(const cv::Mat& frame, const TargetLook& look,
                                               const std::optional<TargetExpectation>& expected);

/// A marker: where its diagonals cross.
[[nodiscard]] TargetDetection find_target_marker(const cv::Mat& grey, const TargetLook& look,
                                                 const std::optional<TargetExpectation>& expected);

/// The pattern (32-bit float) at about `scale` times its size, which is renewed where it is found.
[[nodiscard]] TargetDetection find_target_pattern(const cv::Mat& grey, const cv::Mat& pattern, const TargetLook& look,
                                                  const std::optional<TargetExpectation>& expected, double& scale);

}  // namespace alidade
