#pragma once

#include <Eigen/Core>
#include <cstdint>
#include <optional>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/localize/known_pose.h"

namespace cv {
class Mat;
}

namespace alidade {

/// A small grey image of a point as first seen; the point is its middle.
struct GreyPatch {
  int width_px = 0, height_px = 0;
  std::vector<std::uint8_t> grey;  ///< Row by row.
};

/// What gives scale and the map's frame in images: points that are found by themselves.
struct ImageTarget {
  std::vector<KnownPoint> points;
  std::optional<Eigen::Vector2d> rectangle_m;  ///< Width and height; `points` are its corners. See rectangle_target().
  std::optional<Board> board;                  ///< `points` are its corners.
  std::vector<GreyPatch> patches;              ///< Else: one a point.
};

/// A dark or bright rectangle, the map's frame at its centre, x right, y down as first seen; corners 0 to 3 clockwise
/// from (−, −). The default σ is that of a print on a flat thing.
[[nodiscard]] ImageTarget rectangle_target(double width_m, double height_m, double sigma_m = 0.0003);

/// The target in an image: where its points are, and from where it looks so.
struct SeenTarget {
  std::vector<FeatureObservation> observations;
  std::vector<StartHypothesis> starts;  ///< The better one first.
  std::size_t num_alike = 1;            ///< Things in the image that might as well be the target.
};

/// None where it is not found, or where what is found does not have its shape. Of several rectangles with its shape the
/// one of most contrast and least pattern inside; `num_alike` counts those elsewhere that are nearly as good.
[[nodiscard]] std::optional<SeenTarget> find_target(const cv::Mat& grey, const Camera& camera,
                                                    const ImageTarget& target, const KnownPoseConfig& config);

}  // namespace alidade
