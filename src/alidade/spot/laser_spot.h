#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/camera/camera.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace cv {
class Mat;
}

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// `automatic`: in a colour photo red or green, whichever is stronger; in a grey photo bright.
enum class SpotColour { automatic, red, green, bright };

struct LaserSpotConfig {
  SpotColour colour = SpotColour::automatic;
  double min_snr = 8.0;         ///< SNR of the smoothed peak; noise alone reaches 6 once in ten thousand photos.
  double max_radius_px = 40.0;  ///< Wider ones are coloured objects, not laser spots.
  double rival_share = 0.2;  ///< A second spot with this fraction of the light of the first makes the result ambiguous.
};

/// A board with a known pose in the photo.
struct SeenBoard {
  Board board;
  Camera camera;
  Rigid3 cam_from_board;
};

/// Additional knowledge: every part helps and none is required, except that a grey photo needs one of the first two.
struct LaserSpotAids {
  const cv::Mat* photo_off = nullptr;  ///< The same view with the laser off; exposure and position may differ a little.
  std::optional<SeenBoard> seen_board;  ///< The spot is searched for on its print only.
  std::vector<Eigen::Vector2d> region;  ///< Polygon [px] that contains the spot; empty: the whole image.
};

/// The laser spot in a photo, or the reason why there is none.
struct LaserSpot {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< Noise, pixel sampling, residual of the edge correction. [px²]
  double peak = 0.0;                                  ///< Light above the background, in grey values of the channel.
  double radius_px = 0.0;                             ///< σ of the spot, mean of its axes.
  bool is_saturated = false;                          ///< Its centre exceeds the sensor's range.
  bool is_on_edge = false;  ///< It lies across ink and paper and is corrected for their reflectances.
  std::string reason;       ///< "no laser spot", "two candidates at (u, v) and (u, v)", …; empty if it was found.
  [[nodiscard]] bool found() const { return reason.empty(); }
};

/// Detects the laser spot in a photo (8- or 16-bit, grey or BGR): the intensity centroid of the light that the laser
/// adds. That light is the difference from `photo_off`; without it, in a colour photo, the excess of the laser's
/// channel over the other two, in a grey photo the excess over the board's ink and paper. For a spot across ink and
/// paper, a Gaussian times their reflectances is fitted, because the centroid is biased towards the paper.
/// Two spots of comparable light are reported; none of them is chosen.
/// The centroid is that of Wang & Li (2020); the correction on edges is ours.
[[nodiscard]] LaserSpot find_laser_spot(const cv::Mat& photo, const LaserSpotAids& aids = {},
                                        const LaserSpotConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
