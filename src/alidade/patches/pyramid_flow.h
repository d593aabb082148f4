#pragma once

#include <Eigen/Core>
#include <optional>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// An image and its successive halvings, 32-bit float, finest first.
[[nodiscard]] std::vector<cv::Mat> pyramid_of(const cv::Mat& smoothed, int max_levels);

/// Where the surroundings of `px` in one image are in another, from a guess: pure translation, coarse to fine, to about
/// a tenth of a pixel. Empty if not found or outside the image. B. Lucas & T. Kanade 1981; J.-Y. Bouguet, "Pyramidal
/// implementation of the Lucas Kanade feature tracker", 2000.
[[nodiscard]] std::optional<Eigen::Vector2d> find_shifted(const std::vector<cv::Mat>& from,
                                                          const std::vector<cv::Mat>& to, const Eigen::Vector2d& px,
                                                          const Eigen::Vector2d& guess_px);

}  // namespace alidade
