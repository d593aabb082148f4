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

/// `automatic`: red or green, whichever is stronger, in a colour photo; bright in a grey one.
enum class SpotColour { automatic, red, green, bright };

struct LaserSpotConfig {
  SpotColour colour = SpotColour::automatic;
  double min_snr = 8.0;         ///< Of the spot's peak, smoothed: noise reaches 6 once in ten thousand photos.
  double max_radius_px = 40.0;  ///< Wider ones are coloured objects, not spots.
  double rival_share = 0.2;     ///< A second spot with this share of the first one's light is a rival.
};

/// A board whose pose in the photo is known.
struct SeenBoard {
  Board board;
  Camera camera;
  Rigid3 cam_from_board;
};

/// What is known beside the photo; each part helps and none is needed, but a grey photo needs one of the first two.
struct LaserSpotAids {
  const cv::Mat* photo_off = nullptr;   ///< The same with the laser off; exposure and position may differ a little.
  std::optional<SeenBoard> seen_board;  ///< The spot is looked for on its print alone.
  std::vector<Eigen::Vector2d> region;  ///< Polygon in which the spot lies [px]; empty: anywhere.
};

/// The laser spot in a photo, or the reason why there is none.
struct LaserSpot {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  Eigen::Matrix2d cov = Eigen::Matrix2d::Identity();  ///< Noise, pixels, and what an edge below the spot leaves. [px²]
  double peak = 0.0;                                  ///< Light over the background, in grey values of its channel.
  double radius_px = 0.0;                             ///< σ of the spot, mean of its axes.
  bool is_saturated = false;                          ///< Its centre exceeds the camera's range.
  bool is_on_edge = false;  ///< It lies on ink and paper, and is corrected for what each returns.
  std::string reason;       ///< "no laser spot", "two candidates at (u, v) and (u, v)", …; empty where it was found.
  [[nodiscard]] bool found() const { return reason.empty(); }
};

/// Finds the laser spot in a photo (8- or 16-bit, grey or BGR): the intensity centroid of the light that the laser
/// adds. That light is the difference to `photo_off`; without it, in a colour photo, what its channel has in excess of
/// the other two; in a grey one, what exceeds the board's ink and paper. A spot across ink and paper is the fit of a
/// Gaussian times what each returns, since its centroid leans to the paper.
/// Two spots of comparable light are named, not chosen from.
/// The centroid is that of Wang & Li (2020); the correction on edges is ours.
[[nodiscard]] LaserSpot find_laser_spot(const cv::Mat& photo, const LaserSpotAids& aids = {},
                                        const LaserSpotConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
