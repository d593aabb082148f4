#pragma once

#include <Eigen/Core>
#include <string>

#include "alidade/spot/laser_spot.h"

namespace alidade {

/// One channel of a part of a photo, rows v and columns u.
using Image = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ImageMask = Eigen::Array<unsigned char, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  ///< 255: yes

/// What the laser may have added to one channel of a part of a photo, in grey values.
struct SpotSignal {
  Image detected;            ///< Light over what is expected, in which spots are looked for.
  Image light;               ///< The same, best for measuring.
  Image background;          ///< What the channel would show without the laser.
  Image edge;                ///< Length of the background's gradient [grey/px].
  ImageMask is_saturated;    ///< The channel is at its limit.
  ImageMask is_in_region;    ///< A spot may be here.
  int u_min = 0, v_min = 0;  ///< The part's first pixel in the photo.
  int photo_cols = 0, photo_rows = 0;
  double sigma = 1.0;           ///< Noise of `detected`.
  double sum_sigma = 1.0;       ///< White noise that would move sums over many pixels as much: neighbours share theirs.
  double smoothed_sigma = 0.3;  ///< Noise of `detected` smoothed by a Gaussian of 1 px.
  double step = 0.0;            ///< Of flat areas' levels, as JPEG leaves them; 0: not compressed.
  double smoothed_edge_sigma_px = 0.0;  ///< What remains of it at edges, as an uncertainty of their position.
  double edge_sigma_px = 0.0;           ///< What remains at edges, as an uncertainty of their position.
  bool is_excess = false;               ///< `detected` is what the channel has in excess of the others.
  bool is_interpolated = false;         ///< Its noise is a mosaic's, or was compressed away.
  bool background_is_lit = false;       ///< It was taken from channels that see some of the laser's light.
  bool is_modelled = false;  ///< `light` is the difference to a model of the print, not to a photo or channel.
  std::string reason;        ///< Why there is no signal; empty where there is one.
};

/// The signal in one channel of BGR; 3 is the grey photo. Fails by name where there is nothing to compare with.
[[nodiscard]] SpotSignal spot_signal(const cv::Mat& photo, int channel, const LaserSpotAids& aids);

}  // namespace alidade
