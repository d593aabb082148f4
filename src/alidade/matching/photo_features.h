#pragma once

#include <Eigen/Core>
#include <vector>

#include "alidade/matching/matched_photos.h"

namespace cv {
class Mat;
}

namespace alidade {

/// One row per feature: its descriptor, of unit length, so that the product of two is their similarity.
using Descriptors = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;

/// Points of a photo that can be recognised in another.
struct PhotoFeatures {
  std::vector<Eigen::Vector2d> px;  ///< Pixels in the original photo.
  Descriptors descriptors;
};

struct FeatureConfig {
  double max_megapixels = 1.6;  ///< A larger photo is reduced to this size for detection.
  int max_features = 2600;      ///< Spread over the photo: the strongest in each of 8 × 6 cells.
};

/// Features of a photo, grey or colour, 8 or 16 bit: Lowe's SIFT (IJCV 60, 2004) by OpenCV, with root descriptors
/// (Arandjelović & Zisserman, CVPR 2012). One position is one feature.
[[nodiscard]] PhotoFeatures find_features(const cv::Mat& photo, const FeatureConfig& config = {});

/// Mutual nearest neighbours among the features of a and b, nearer than `ratio` of the second nearest.
[[nodiscard]] std::vector<FeatureMatch> match_features(const Descriptors& a, const Descriptors& b, double ratio = 0.8);

}  // namespace alidade
