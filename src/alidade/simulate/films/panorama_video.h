#pragma once

#include <cstdint>

#include "alidade/simulate/films/far_world.h"
#include "alidade/simulate/rotation.h"

namespace alidade {

struct PanoramaConfig {
  double blur_px = 0.6;       ///< σ of the optical blur.
  double noise = 2.0;         ///< σ of the grey noise, in grey values of 255.
  double moving_share = 0.0;  ///< Of a frame of a scene: discs that move by 4 to 20 px a second, with what is on them.
  int oversampling = 2;       ///< Sub-samples a pixel and axis; more change no edge by 0.002 px (tested).
};

/// What a camera at the centre of that world sees, 8-bit grey: rays through the lens, the world's light, blurred by the
/// optics, integrated over each pixel, with noise, rounded. `seed` draws the noise. Exact to 0.01 px (tested).
[[nodiscard]] cv::Mat render_panorama(FarWorld& world, const RotatingIntrinsics& intrinsics, int width_px,
                                      int height_px, const Eigen::Quaterniond& base_from_cam,
                                      const PanoramaConfig& config, std::uint64_t seed);

/// True base_from_cam of the scene at a time. For videos `motion` gives pan, tilt, roll, whatever the log's source;
/// points, depths and lever arm play no part. The base is the head's; the mount is off it by scene.mount_rad.
[[nodiscard]] Eigen::Quaterniond true_base_from_cam(const RotationScene& scene, double t_s);

/// The frame that is taken in row k of panorama_log(): at k / rate, of the world as it is seen delay_s later, its rows
/// over shutter_s about that.
[[nodiscard]] cv::Mat render_panorama_frame(FarWorld& world, const RotationScene& scene, std::size_t k, double rate_hz,
                                            const PanoramaConfig& config, std::uint64_t seed);

/// What is measured of the rotation, one row a frame, without points; with the true intrinsics. For source `rate` the
/// rates are those of the head.
[[nodiscard]] RotationLog panorama_log(const RotationScene& scene, const RotationLogConfig& config, std::uint64_t seed);

}  // namespace alidade
