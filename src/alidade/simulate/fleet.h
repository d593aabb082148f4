#pragma once

#include <array>
#include <cstdint>
#include <limits>
#include <string>
#include <vector>

namespace alidade {

/// An event of a camera in a simulated fleet.
enum class FleetEvent { none, belt_slip, bracket_sag, focal_drift, frozen };
[[nodiscard]] std::string event_word(FleetEvent event);

struct FleetSceneConfig {
  int width_px = 640, height_px = 480;
  double rate_hz = 1.0, noise_px = 0.3;
  double event_after_s = 120.0;  ///< Earliest time of the event; the latest is twice that.
  double slip_sigmas = 0.0;      ///< Size of a slip or sag in σ of one row; 0: drawn, 0.1° to 1°.
  double event_share = 0.2;      ///< Share of the cameras with an event, one each.
  /// Above 0: the temperature rises by this much (half a cosine, from 10 °C), rows contain it, and instead of the
  /// events the focal length of that share of the cameras follows it.
  double warming_c = 0.0, warming_s = 7200.0;
};

/// A camera: a head that patrols, four static points, and its event, all a function of (seed,
/// index).
struct FleetScene {
  std::string id;  ///< "c00001"
  double fx = 0.0, fy = 0.0, cx = 0.0, cy = 0.0;
  std::array<double, 4> sway_rad{}, phase{};  ///< Two waves each of pan and tilt.
  std::array<double, 8> direction{};          ///< Pan and tilt of the points [rad].
  FleetEvent event = FleetEvent::none;
  double focal_per_c = 0.0;                  ///< Relative change of the focal length per °C.
  double event_t_s = 0.0, event_size = 0.0;  ///< Slip [rad], sag [rad], or relative change of focal length.
};

/// The camera's n-th row, counted from 1: a function of (scene, config, seed, n).
struct FleetObservation {
  double t_s = 0.0, pan_rad = 0.0, tilt_rad = 0.0;
  double temperature_c = std::numeric_limits<double>::quiet_NaN();
  std::array<double, 8> px{};
};

[[nodiscard]] FleetScene draw_fleet_scene(const FleetSceneConfig& config, std::uint64_t seed, int index);
[[nodiscard]] FleetObservation simulate_observation(const FleetScene& scene, const FleetSceneConfig& config,
                                                    std::uint64_t seed, std::int64_t n);

}  // namespace alidade
