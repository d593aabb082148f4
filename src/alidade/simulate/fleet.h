#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace alidade {

/// What happens to a camera of a simulated fleet.
enum class FleetEvent { none, belt_slip, bracket_sag, focal_drift, frozen };
[[nodiscard]] std::string event_word(FleetEvent event);

struct FleetSceneConfig {
  int width_px = 640, height_px = 480;
  double rate_hz = 1.0, noise_px = 0.3;
  double event_after_s = 120.0;  ///< The earliest; within as long again it has come.
  double slip_sigmas = 0.0;      ///< A slip or sag of so many σ of one row; 0: drawn, 0.1° to 1°.
  double event_share = 0.2;      ///< Of the cameras, one of the events each.
  /// Above 0: it gets so much warmer (as half a cosine, from 10 °C on), rows say the temperature, and instead of the
  /// events the focal length of that share of the cameras follows it.
  double warming_c = 0.0, warming_s = 7200.0;
};

/// A camera: a head that patrols, four static points, and what happens to it, all a function of (seed,
/// index).
struct FleetScene {
  std::string id;  ///< "c00001"
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  std::array<double, 4> sway_rad{}, phase{};  ///< Of pan and tilt, two waves each.
  std::array<double, 8> direction{};          ///< Of the points: pan, tilt [rad].
  FleetEvent event = FleetEvent::none;
  double focal_per_c = 0.0;                  ///< Relative.
  double event_t_s = 0.0, event_size = 0.0;  ///< rad of a slip, rad of a sag, relative of a focal length.
};

/// What the camera says at its n-th row, from 1: a function of (scene, config, seed, n).
struct FleetObservation {
  double t_s = 0.0, pan_rad = 0.0, tilt_rad = 0.0;
  double temperature_c = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 8> px{};
};

[[nodiscard]] FleetScene draw_fleet_scene(const FleetSceneConfig& config, std::uint64_t seed, int index);
[[nodiscard]] FleetObservation simulate_observation(const FleetScene& scene, const FleetSceneConfig& config,
                                                    std::uint64_t seed, std::int64_t n);

}  // namespace alidade
