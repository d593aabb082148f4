#include "alidade/simulate/fleet.h"

#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <functional>
#include <numbers>

#include "alidade/geometry/degree.h"
#include "alidade/pantilt/head_rotation.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

std::uint64_t fleet_seed(std::uint64_t seed, std::uint64_t id, std::uint64_t n) {
  std::uint64_t z = seed * 0x9e3779b97f4a7c15U + id * 0xd1b54a32d192ed03U + n * 0x8cb92ba72f3d8dd7U;
  z = (z ^ (z >> 30U)) * 0xbf58476d1ce4e5b9U;
  z = (z ^ (z >> 27U)) * 0x94d049bb133111ebU;
  return z ^ (z >> 31U);
}

std::uint64_t number_of(const std::string& id) { return std::stoull(id.substr(1)); }

/// 0 before the event; a step, or growing to 1 within a minute and then staying.
double grown(const FleetScene& scene, double t_s) {
  const double since_s = t_s - scene.event_t_s;
  if (scene.event == FleetEvent::none || since_s < 0.0) return 0.0;
  return scene.event == FleetEvent::belt_slip ? 1.0 : std::min(1.0, since_s / 60.0);
}

}  // namespace

std::string event_word(FleetEvent event) {
  switch (event) {
    case FleetEvent::belt_slip:
      return "belt_slip";
    case FleetEvent::bracket_sag:
      return "bracket_sag";
    case FleetEvent::focal_drift:
      return "focal_drift";
    case FleetEvent::frozen:
      return "frozen";
    case FleetEvent::none:
      break;
  }
  return "none";
}

FleetScene draw_fleet_scene(const FleetSceneConfig& config, std::uint64_t seed, int index) {
  Draws draws(fleet_seed(seed, static_cast<std::uint64_t>(index) + 1, 0));
  FleetScene scene;
  char id[16];
  std::snprintf(id, sizeof id, "c%05d", index + 1);
  scene.id = id;
  scene.fx = config.width_px * draws.uniform(0.9, 1.6);
  scene.fy = scene.fx * draws.uniform(0.99, 1.01);
  scene.cx = 0.5 * (config.width_px - 1.0) + draws.uniform(-10.0, 10.0);
  scene.cy = 0.5 * (config.height_px - 1.0) + draws.uniform(-10.0, 10.0);
  const double view_x = config.width_px / scene.fx, view_y = config.height_px / scene.fy;
  scene.sway_rad = {0.10 * view_x, 0.05 * view_x, 0.10 * view_y, 0.05 * view_y};
  for (double& phase : scene.phase) phase = draws.uniform(0.0, 2.0 * std::numbers::pi);
  for (int k = 0; k < 4; ++k) {
    // One in each quarter of the image.
    scene.direction[static_cast<std::size_t>(2 * k)] = (k % 2 == 0 ? 1.0 : -1.0) * draws.uniform(0.10, 0.30) * view_x;
    scene.direction[static_cast<std::size_t>(2 * k + 1)] = (k < 2 ? 1.0 : -1.0) * draws.uniform(0.10, 0.30) * view_y;
  }
  const double chance = draws.uniform(), kind = draws.uniform(), size = draws.uniform(), sign = draws.uniform();
  scene.event_t_s = config.event_after_s * (1.0 + draws.uniform());
  if (chance >= config.event_share) return scene;
  if (config.warming_c > 0.0) {
    scene.focal_per_c = (sign < 0.5 ? -1.0 : 1.0) * (5e-5 + 2e-4 * size);
    return scene;
  }
  scene.event = static_cast<FleetEvent>(1 + static_cast<int>(4.0 * kind));
  scene.event_size = scene.event == FleetEvent::focal_drift ? 0.01 + 0.02 * size : (0.1 + 0.9 * size) * degree;
  if (config.slip_sigmas > 0.0) {
    scene.event = FleetEvent::belt_slip;
    scene.event_size = config.slip_sigmas * config.noise_px / scene.fx / 2.0;  // of four points' mean
  }
  if (sign < 0.5) scene.event_size = -scene.event_size;
  return scene;
}

FleetObservation simulate_observation(const FleetScene& scene, const FleetSceneConfig& config, std::uint64_t seed,
                                      std::int64_t n) {
  FleetObservation observation;
  observation.t_s = static_cast<double>(n - 1) / config.rate_hz;
  const double at = grown(scene, observation.t_s);
  const bool is_frozen = scene.event == FleetEvent::frozen && observation.t_s >= scene.event_t_s;
  const auto angles_at = [&](double t_s) {
    const auto& s = scene.sway_rad;
    const auto& f = scene.phase;
    return Eigen::Vector3d(s[0] * std::sin(0.31 * t_s + f[0]) + s[1] * std::sin(0.83 * t_s + f[1]),
                           s[2] * std::sin(0.43 * t_s + f[2]) + s[3] * std::sin(1.07 * t_s + f[3]), 0.0);
  };
  const Eigen::Vector3d read = angles_at(observation.t_s);
  observation.pan_rad = read.x();
  observation.tilt_rad = read.y();
  // A frozen image is that of the moment, with its noise.
  const std::int64_t seen_n =
      is_frozen ? static_cast<std::int64_t>(std::ceil(scene.event_t_s * config.rate_hz)) + 1 : n;
  Eigen::Vector3d truth = is_frozen ? angles_at(static_cast<double>(seen_n - 1) / config.rate_hz) : read;
  if (scene.event == FleetEvent::belt_slip) truth.x() += at * scene.event_size;
  if (scene.event == FleetEvent::bracket_sag) truth.y() += at * scene.event_size;
  double zoom = scene.event == FleetEvent::focal_drift ? 1.0 + at * scene.event_size : 1.0;
  if (config.warming_c > 0.0) {
    const double warmer_c =
        0.5 * config.warming_c * (1.0 - std::cos(std::numbers::pi * std::min(1.0, observation.t_s / config.warming_s)));
    observation.temperature_c = 10.0 + warmer_c;
    zoom *= 1.0 + scene.focal_per_c * warmer_c;
  }
  const Eigen::Quaterniond cam_from_base = base_from_cam_rotation(truth).conjugate();
  Draws draws(fleet_seed(seed, number_of(scene.id), static_cast<std::uint64_t>(seen_n)));
  for (std::size_t k = 0; k < 4; ++k) {
    const Eigen::Vector3d ray =
        base_from_cam_rotation({scene.direction[2 * k], scene.direction[2 * k + 1], 0.0}) * Eigen::Vector3d::UnitZ();
    const Eigen::Vector3d p = cam_from_base * ray;
    const Eigen::Vector2d noise = config.noise_px * draws.normal2();
    observation.px[2 * k] = zoom * scene.fx * p.x() / p.z() + scene.cx + noise.x();
    observation.px[2 * k + 1] = zoom * scene.fy * p.y() / p.z() + scene.cy + noise.y();
  }
  return observation;
}

}  // namespace alidade
