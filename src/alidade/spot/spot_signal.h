#pragma once

#include <Eigen/Core>
#include <string>

#include "alidade/spot/laser_spot.h"

namespace alidade {

/// One channel of part of a photo, rows v and columns u.
using Image = Eigen::Array<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using ImageMask = Eigen::Array<unsigned char, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;  ///< 255: yes

/// The laser light in one channel of part of a photo, in grey values.
struct SpotSignal {
  Image detected;            ///< Light above what is expected, in which spots are searched for.
  Image light;               ///< The same, in the form best for measuring.
  Image background;          ///< What the channel would show without the laser.
  Image edge;                ///< Magnitude of the background's gradient [grey/px].
  ImageMask is_saturated;    ///< The channel is at its upper limit.
  ImageMask is_in_region;    ///< A spot may be at this pixel.
  int u_min = 0, v_min = 0;  ///< First pixel of the part in the photo.
  int photo_cols = 0, photo_rows = 0;
  double sigma = 1.0;           ///< Noise of `detected`.
  double sum_sigma = 1.0;       ///< White noise with the same effect on sums over many pixels: noise is correlated.
  double smoothed_sigma = 0.3;  ///< Noise of `detected` after smoothing by a Gaussian of 1 px.
  double step = 0.0;            ///< Quantisation step of flat areas, from JPEG; 0: not compressed.
  double smoothed_edge_sigma_px = 0.0;  ///< Residual of the smoothed signal at edges, as uncertainty of their position.
  double edge_sigma_px = 0.0;           ///< Residual at edges, as uncertainty of their position.
  bool is_excess = false;               ///< `detected` is the excess of the channel over the others.
  bool is_interpolated = false;         ///< Its noise is that of a demosaicked image, or was removed by compression.
  bool background_is_lit = false;       ///< It comes from channels that contain some of the laser's light.
  bool is_modelled = false;  ///< `light` is the difference from a model of the print, not from a photo or channel.
  std::string reason;        ///< Why there is no signal; empty if there is one.
};

/// The signal in one channel of BGR; 3 is the grey photo. Fails with a reason if there is nothing to compare with.
[[nodiscard]] SpotSignal spot_signal(const cv::Mat& photo, int channel, const LaserSpotAids& aids);

}  // namespace alidade
