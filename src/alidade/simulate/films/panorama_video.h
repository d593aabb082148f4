#pragma once

#include <cstdint>

#include "alidade/simulate/films/far_world.h"
#include "alidade/simulate/rotation.h"

namespace alidade {

struct PanoramaConfig {
  double blur_px = 0.6;       ///< σ of the optical blur.
  double noise = 2.0;         ///< σ of the grey noise, in grey values of 255.
  double moving_share = 0.0;  ///< Share of a frame covered by discs that move with 4 to 20 px/s, with their texture.
  int oversampling = 2;       ///< Sub-samples per pixel and axis; more change no edge by 0.002 px (tested).
};

/// Image of a camera at the centre of that world, 8-bit grey: rays through the lens, the world's light, blurred by the
/// optics, integrated over each pixel, with noise, rounded. `seed` determines the noise. Exact to 0.01 px (tested).
[[nodiscard]] cv::Mat render_panorama(FarWorld& world, const RotatingIntrinsics& intrinsics, int width_px,
                                      int height_px, const Eigen::Quaterniond& base_from_cam,
                                      const PanoramaConfig& config, std::uint64_t seed);

/// True base_from_cam of the scene at a time. For videos `motion` gives pan, tilt, roll, whatever the log's source;
/// points, depths and lever arm are not used. The base is the head's; the mount differs from it by scene.mount_rad.
[[nodiscard]] Eigen::Quaterniond true_base_from_cam(const RotationScene& scene, double t_s);

/// The frame of row k of panorama_log(): taken at k / rate, it shows the world delay_s later, with its rows spread over
/// shutter_s about that time.
[[nodiscard]] cv::Mat render_panorama_frame(FarWorld& world, const RotationScene& scene, std::size_t k, double rate_hz,
                                            const PanoramaConfig& config, std::uint64_t seed);

/// The measured rotation, one row per frame, without points; with the true intrinsics. For source `rate` the rates are
/// those of the head.
[[nodiscard]] RotationLog panorama_log(const RotationScene& scene, const RotationLogConfig& config, std::uint64_t seed);

}  // namespace alidade
