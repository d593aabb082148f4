#include "alidade/simulate/track.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

#include "alidade/estimation/motion_models.h"
#include "alidade/simulate/draws.h"

namespace alidade {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Where the paper's target starts, of which the circles are drawn. [m]
const Vector3d circle_start(0.173, -0.314, 0.636);

std::function<Vector3d(double)> circle(double radius_m, double period_s) {
  return [=](double t_s) { return Vector3d(circle_start + circle_offset(radius_m, period_s, t_s)); };
}

/// The paper's heads as they would be built: axes that do not meet, bases and cameras a few degrees askew.
void make_general(std::vector<RigHead>& heads) {
  heads[0].head.pan_to_tilt_m = {0.012, -0.021, 0.016};
  heads[0].head.tilt_to_cam_m = {-0.014, 0.011, 0.028};
  heads[0].head.cam_from_tilt = exp_so3({0.035, -0.044, 0.052});
  heads[0].head.world_from_base.rotation = exp_so3({-0.038, 0.042, 0.036});
  heads[1].head.pan_to_tilt_m = {-0.017, 0.013, -0.022};
  heads[1].head.tilt_to_cam_m = {0.019, -0.025, 0.015};
  heads[1].head.cam_from_tilt = exp_so3({-0.047, 0.036, -0.041});
  heads[1].head.world_from_base.rotation = exp_so3({0.051, -0.037, -0.044});
}

struct Turn {
  double start_s, duration_s;
  Vector3d axis;
};
constexpr double turn_rate_rad_s = 4.0;  // 1.5 m/s round 0.375 m: 6 m/s²

const std::array<Turn, 5> turns{{{1.4985, 0.767, {0.0, -0.98665574, -0.16282031}},
                                 {3.7655, 0.433, {0.00830493, -0.99868267, -0.05063544}},
                                 {5.6985, 0.631, {0.27225479, -0.96188979, -0.02540382}},
                                 {7.8295, 0.529, {0.24943754, -0.96831824, -0.01186178}},
                                 {9.8585, 0.346, {0.24783512, -0.93820624, -0.24155083}}}};

/// ∫ Exp(axis ω s) v ds over an unfinished rotation.
Vector3d moved_in_turn(const Vector3d& velocity, const Vector3d& axis, double angle) {
  return (std::sin(angle) * velocity + (1.0 - std::cos(angle)) * axis.cross(velocity)) / turn_rate_rad_s;
}

/// A head that follows its target: first order, the target's angles constant for 5 ms.
class Follower {
 public:
  Follower(const TrackScene& scene, std::size_t head) : scene_(scene), head_(scene.heads[head].head) {
    angles_ = aimed(0.0).value_or(Vector2d::Zero());
  }
  /// Readings without noise at a time; call in order of time.
  const Vector2d& at(double t_s) {
    const int steps = std::max(1, static_cast<int>(std::ceil((t_s - t_s_) / 0.005)));
    const double dt_s = (t_s - t_s_) / steps;
    const double share = scene_.aiming_lag_s > 0.0 ? 1.0 - std::exp(-dt_s / scene_.aiming_lag_s) : 1.0;
    for (int i = 1; i <= steps; ++i) {
      const auto goal = aimed(t_s_ + (scene_.aiming_lag_s > 0.0 ? i - 0.5 : i) * dt_s);
      if (goal) angles_ += share * (*goal - angles_);
    }
    t_s_ = t_s;
    return angles_;
  }

 private:
  [[nodiscard]] std::optional<Vector2d> aimed(double t_s) const { return aim(head_, scene_.position(t_s)); }
  const TrackScene& scene_;
  const Head& head_;
  Vector2d angles_;
  double t_s_ = 0.0;
};

bool is_hidden(const TrackScene& scene, std::size_t head, double t_s) {
  return std::ranges::any_of(scene.occlusions, [&](const Occlusion& occlusion) {
    return occlusion.head == head && t_s >= occlusion.from_s && t_s < occlusion.to_s;
  });
}

/// The heads as they are, where the scene's are what the file says.
std::vector<RigHead> heads_as_they_are(const TrackScene& scene) {
  std::vector<RigHead> heads = scene.heads;
  const TrackFaults& faults = scene.faults;
  for (std::size_t h = 0; h < std::min<std::size_t>(2, heads.size()); ++h) {
    heads[h].head.encoder.pan_zero_rad += faults.zero_rad[h].x();
    heads[h].head.encoder.tilt_zero_rad += faults.zero_rad[h].y();
  }
  if (heads.size() < 2) return heads;
  Rigid3& base = heads[1].head.world_from_base;
  const Vector3d first = heads[0].head.world_from_base.translation;
  base.rotation = base.rotation * exp_so3(faults.base_turn_rad);
  base.translation = first + (1.0 + faults.baseline) * (base.translation - first);
  return heads;
}

double rounded_down(double t_s, double step_s) { return step_s * std::floor(t_s / step_s + 1e-9); }

/// How the log distorts an observation: false names, signs and positions.
void spoil(const TrackScene& scene, Draws& draws, SimulatedObservation& observation) {
  const TrackFaults& faults = scene.faults;
  const Camera& camera = scene.heads[observation.head].camera;
  if (faults.time_step_s > 0.0) {
    const double early_s = observation.t_capture_s - rounded_down(observation.t_capture_s, faults.time_step_s);
    observation.t_capture_s -= early_s;
    observation.t_arrival_s -= early_s;
  }
  if (faults.clutter > 0.0) {
    const Vector2d elsewhere(draws.uniform(0.0, camera.width_px - 1.0), draws.uniform(0.0, camera.height_px - 1.0));
    if (draws.uniform(0.0, 1.0) < faults.clutter) observation.px = elsewhere;
  }
  if (faults.mirrored_all || (faults.mirrored && observation.head == 1))
    observation.px.x() = camera.width_px - 1.0 - observation.px.x();
  if (observation.head == 1) {
    observation.t_capture_s += faults.clock_s;
    observation.t_arrival_s += faults.clock_s;
    if (faults.pan_sign) observation.pan_tilt_rad.x() *= -1.0;
    if (faults.tilt_sign) observation.pan_tilt_rad.y() *= -1.0;
  }
  if (faults.swapped && observation.head < 2) observation.head = 1 - observation.head;
  if (faults.milliseconds || (faults.milliseconds_of_one && observation.head == 1))
    observation.t_capture_s *= 1e3, observation.t_arrival_s *= 1e3;
}

void add_observations(const TrackScene& given, std::size_t head, std::uint64_t seed,
                      std::vector<SimulatedObservation>& observations) {
  TrackScene scene = given;
  scene.heads = heads_as_they_are(given);
  const Vector3d apart(0.4, -0.1, 0.0);
  Draws draws(2 * seed + 1000003 * head), others(seed + 500009 * (head + 1));
  Follower follower(scene, head);
  const double late_s = scene.latency_s + (scene.more_latency_s.empty() ? 0.0 : scene.more_latency_s[head]);
  for (int k = 0;; ++k) {
    const double t_s = scene.phase_s[head] + k / scene.rate_hz[head];
    if (t_s > scene.duration_s) return;
    const Vector2d angles = follower.at(t_s);
    const Vector2d noise_px = scene.sigma_px * draws.normal2(), noise_rad = scene.sigma_encoder_rad * draws.normal2();
    const bool is_second = scene.faults.second > 0.0 && others.uniform(0.0, 1.0) < scene.faults.second;
    const auto seen = project(scene.heads[head], angles, is_second ? scene.position(t_s) + apart : scene.position(t_s));
    if (!seen || is_hidden(scene, head, t_s)) continue;
    const Vector2d px = seen->px + noise_px;
    if (!is_in_image(scene.heads[head].camera, px)) continue;
    const double step_s = scene.faults.time_step_s, before_s = t_s - 1.0 / scene.rate_hz[head];
    if (step_s > 0.0 && k > 0 && rounded_down(before_s, step_s) == rounded_down(t_s, step_s)) continue;
    observations.push_back({t_s, t_s + late_s, head, angles + noise_rad, px});
    spoil(given, others, observations.back());
  }
}

TrackScene scene_named(std::string name) {
  TrackScene scene;
  scene.name = std::move(name);
  const std::array<RigHead, 2> rig = xiahou_rig();
  scene.heads.assign(rig.begin(), rig.end());
  for (RigHead& head : scene.heads) head.head.encoder.sigma_rad = scene.sigma_encoder_rad;
  scene.rate_hz = {20.0, 20.0};
  scene.phase_s = {0.0, 0.0};
  return scene;
}

}  // namespace

Eigen::Vector3d circle_offset(double radius_m, double period_s, double t_s) {
  const double angle = 2.0 * std::numbers::pi * t_s / period_s;
  return radius_m * Vector3d(std::cos(angle) - 1.0, std::sin(angle), 0.0);
}

Eigen::Vector3d manoeuvre_position(double t_s) {
  Vector3d position(0.2, -0.2, 3.0), velocity(1.5, 0.0, 0.0);
  double now_s = 0.0;
  for (const Turn& turn : turns) {
    if (t_s <= turn.start_s) break;
    position += (turn.start_s - now_s) * velocity;
    const double turning_s = std::min(t_s - turn.start_s, turn.duration_s);
    const double angle = turn_rate_rad_s * turning_s;
    position += moved_in_turn(velocity, turn.axis, angle);
    velocity = exp_so3(angle * turn.axis) * velocity;
    now_s = turn.start_s + turning_s;
  }
  return position + std::max(0.0, t_s - now_s) * velocity;
}

std::function<Eigen::Vector3d(double)> thrown_ball(const Eigen::Vector3d& from_m, const Eigen::Vector3d& velocity_m_s) {
  constexpr double g = 9.80665, rest_s = 1.0;
  const double flight_s = std::max(0.0, -2.0 * velocity_m_s.y() / g);
  return [=](double t_s) {
    const double s = std::clamp(t_s - rest_s, 0.0, flight_s);
    return Vector3d(from_m + s * velocity_m_s + Vector3d(0.0, 0.5 * g * s * s, 0.0));
  };
}

std::function<Eigen::Vector3d(double)> bouncing_ball(const Eigen::Vector3d& from_m, const Eigen::Vector3d& velocity_m_s,
                                                     double floor_m, double restitution) {
  constexpr double g = 9.80665;
  return [=](double t_s) {
    Vector3d p = from_m, v = velocity_m_s;
    for (int bounce = 0; bounce < 100; ++bounce) {
      const double fall_s = (-v.y() + std::sqrt(v.y() * v.y() + 2.0 * g * (floor_m - p.y()))) / g;
      const double s = std::min(t_s, fall_s);
      p += s * v + Vector3d(0.0, 0.5 * g * s * s, 0.0);
      if (s == t_s) return p;
      t_s -= s;
      v.y() = -restitution * (v.y() + g * s);
      p.y() = floor_m;
    }
    return p;
  };
}

std::function<Vector3d(double)> drawn_path(const Vector3d& start_m, double sigma_a_m_s2, double duration_s,
                                           std::uint64_t seed) {
  Draws draws(seed + 77000);
  const double q = ConstantVelocity{sigma_a_m_s2}.density(), dt_s = 0.05;
  Vector3d p = start_m, v = 0.1 * draws.normal3();
  std::vector<Vector3d> path{p};
  const int steps = static_cast<int>(duration_s / dt_s + 0.5);
  for (int k = 0; k < steps + 1; ++k) {
    const Vector3d a = draws.normal3(), b = draws.normal3();
    // The factor of [Δ³/3, Δ²/2; Δ²/2, Δ].
    p += dt_s * v + std::sqrt(q * dt_s) * dt_s * (0.5 * a + b / std::sqrt(12.0));
    v += std::sqrt(q * dt_s) * a;
    path.push_back(p);
  }
  return [path, dt_s, steps](double t_s) {
    const double at = std::clamp(t_s / dt_s, 0.0, steps + 0.999);
    const auto i = static_cast<std::size_t>(at + 1e-9);
    const double share = std::max(0.0, at - static_cast<double>(i));
    return Vector3d((1.0 - share) * path[i] + share * path[i + 1]);
  };
}

std::vector<std::string> track_scenarios() { return {"A", "A2", "B", "C", "D", "E", "F", "G", "throw", "bounce"}; }

std::optional<TrackScene> track_scenario(std::string_view name) {
  if (std::ranges::count(track_scenarios(), name) == 0) return std::nullopt;
  TrackScene scene = scene_named(std::string(name));
  if (name == "A" || name == "A2") {
    scene.position = circle(0.1, 10.0);
    scene.sigma_a_m_s2 = 0.06;
    if (name == "A2") make_general(scene.heads);
  } else if (name == "B" || name == "E") {
    scene.position = circle(0.2, 3.0);
    scene.duration_s = 6.0;
    scene.sigma_a_m_s2 = 1.0;
  } else if (name == "throw") {
    scene.position = thrown_ball({0.2, 0.1, 3.0}, {0.5, -4.0, 0.2});
    scene.duration_s = 2.8;
    scene.aiming_lag_s = 0.05;
    scene.rate_hz = {60.0, 60.0};
    scene.sigma_a_m_s2 = 10.0;
  } else if (name == "bounce") {
    scene.position = bouncing_ball({-0.6, -0.2, 3.0}, {0.3, 0.0, 0.05}, 0.5, 0.9);
    scene.duration_s = 5.0;
    scene.aiming_lag_s = 0.05;
    scene.rate_hz = {25.0, 25.0};
    scene.phase_s = {0.0, 0.019};
    scene.sigma_a_m_s2 = 10.0;
  } else {
    scene.position = manoeuvre_position;
    scene.duration_s = 11.0;
    scene.sigma_a_m_s2 = 4.0;  // below the turns' 6 m/s², which last a third of the time
  }
  if (name == "E" || name == "F") scene.latency_s = 0.1;
  if (name == "G") {
    scene.rate_hz = {20.0, 30.0};
    scene.phase_s = {0.0, 0.007};
  }
  if (name == "D") scene.occlusions = {{1, 3.0, 5.0}, {0, 7.0, 7.5}, {1, 7.0, 7.5}};
  return scene;
}

std::vector<SimulatedObservation> simulate_track(const TrackScene& scene, std::uint64_t seed) {
  std::vector<SimulatedObservation> observations;
  for (std::size_t head = 0; head < scene.heads.size(); ++head) add_observations(scene, head, seed, observations);
  std::ranges::stable_sort(observations, {}, &SimulatedObservation::t_arrival_s);
  return observations;
}

}  // namespace alidade
