#pragma once

#include <Eigen/Core>
#include <vector>

namespace cv {
class Mat;
}

namespace alidade {

/// A point where four areas meet, alternately bright and dark: a possible chessboard corner, by its surroundings.
struct SaddlePoint {
  Eigen::Vector2f px = Eigen::Vector2f::Zero();
  /// Directions [rad] of the two edges, angle[0] in [0, π), angle[1] in (angle[0], angle[0] + π); the sector from
  /// angle[0] to angle[1] (towards increasing angle) is bright.
  float angle_rad[2] = {0.0f, 0.0f};
  float strength = 0.0f;  ///< -det of the Hessian [grey²/px⁴].
  float middle = 0.0f;    ///< Grey value between bright and dark on the ring around it.
  float contrast = 0.0f;  ///< Half the step on that ring, in grey values.
};

/// Saddle points of an image (one channel, 32-bit float, 0 to 255): local maxima of -det Hessian of the smoothed
/// image where a ring of radius 4 px crosses its mid-grey exactly four times, along two straight lines.
[[nodiscard]] std::vector<SaddlePoint> find_saddle_points(const cv::Mat& photo);

}  // namespace alidade
