#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/matching/matched_photos.h"

namespace cv {
class Mat;
}

namespace alidade {

/// One row a feature: its descriptor, of unit length, so that the product of two says how alike they are.
using Descriptors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Points of a photo that can be known again in another.
struct PhotoFeatures {
  std::vector<Eigen::Vector2d> px;  ///< In the photo as it is.
  Descriptors descriptors;
};

struct FeatureConfig {
  double max_megapixels = 1.6;  ///< A larger photo is looked at smaller.
  int max_features = 2600;      ///< Spread over the photo: the strongest of each of 8 × 6 cells.
};

/// Features of a photo, grey or colour, 8 or 16 bit: Lowe's SIFT (IJCV 60, 2004) as OpenCV has it, with descriptors
/// compared as roots (Arandjelović & Zisserman, CVPR 2012). One position is one feature.
[[nodiscard]] PhotoFeatures find_features(const cv::Mat& photo, const FeatureConfig& config = {});

/// Matches of a's features with b's, each the other's nearest, and nearer than `ratio` of the second nearest.
[[nodiscard]] std::vector<FeatureMatch> match_features(const Descriptors& a, const Descriptors& b, double ratio = 0.8);

}  // namespace alidade
