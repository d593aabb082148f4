#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/pantilt/head.h"

namespace alidade {

/// A time during which a head sees nothing.
struct Occlusion {
  std::size_t head;
  double from_s, to_s;
};

/// What of a rig, of its clocks and images is not as its file says. Of two heads it is the second one, but for the
/// zeros.
struct TrackFaults {
  Eigen::Vector3d base_turn_rad = Eigen::Vector3d::Zero();  ///< About x (pitch), y (yaw), z (roll) of its base.
  double baseline = 0.0;                                    ///< It stands further away by this share.
  std::array<Eigen::Vector2d, 2> zero_rad{Eigen::Vector2d::Zero(),
                                          Eigen::Vector2d::Zero()};  ///< (pan, tilt), one per head.
  double clock_s = 0.0;  ///< Its images say that they were taken so much later than they were.
  double time_step_s =
      0.0;  ///< Above 0: times of all heads are rounded down to it; of images of one time the first is left.
  double clutter = 0.0;   ///< Share of the observations, of both heads, that are anywhere in the image instead.
  double second = 0.0;    ///< Share of the observations that are of another target, 0.4 m to the right and 0.1 m above.
  bool swapped = false;   ///< The heads' names.
  bool mirrored = false;  ///< Its images, left to right.
  bool mirrored_all = false;                 ///< Those of all heads.
  bool milliseconds = false;                 ///< All times are in them.
  bool milliseconds_of_one = false;          ///< Its times are.
  bool pan_sign = false, tilt_sign = false;  ///< Its angles, reversed.
};

/// A world for `track`: where the target goes, and the heads that follow it, each late by a first-order lag.
struct TrackScene {
  std::string name;
  std::vector<RigHead> heads;
  std::function<Eigen::Vector3d(double t_s)> position;  ///< In the world. [m]
  double duration_s = 10.0;
  std::vector<double> rate_hz;         ///< One per head: images.
  std::vector<double> phase_s;         ///< One per head: when its first image is taken.
  double latency_s = 0.0;              ///< Capture to arrival.
  std::vector<double> more_latency_s;  ///< One per head, added; empty: none.
  double aiming_lag_s = 0.34;          ///< Time constant of the heads. 0: they always point at the target.
  double sigma_px = 0.5, sigma_encoder_rad = 0.0008726646259971648;
  double sigma_a_m_s2 = 1.0;  ///< What a filter should be given for the target.
  std::vector<Occlusion> occlusions;
  TrackFaults faults;
};

/// One image of one head: what the encoders read at its capture, and where the target was seen.
struct SimulatedObservation {
  double t_capture_s = 0.0, t_arrival_s = 0.0;
  std::size_t head = 0;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
};

/// The scenarios by name: A (slow circle), A2 (the same, heads with offsets and rotated mountings), B (fast circle),
/// C (manoeuvre), D (C, occluded), E (B, 100 ms late), F (C, 100 ms late), G (C, 20 and 30 images a second), throw
/// (a ball at rest, thrown up at 4 m/s, caught, at rest), bounce (a ball on the floor). None for an unknown name.
[[nodiscard]] std::optional<TrackScene> track_scenario(std::string_view name);
[[nodiscard]] std::vector<std::string> track_scenarios();

/// From the start of a circle in a plane of constant z, which begins at +x of its centre.
[[nodiscard]] Eigen::Vector3d circle_offset(double radius_m, double period_s, double t_s);

/// The manoeuvre of scenario C: 11 s between 0.9 and 3.9 m, up to 1.5 m/s and 6 m/s².
[[nodiscard]] Eigen::Vector3d manoeuvre_position(double t_s);

/// A ball that rests at a point for a second, is thrown with this velocity, and caught and held where it comes back to
/// its height.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> thrown_ball(const Eigen::Vector3d& from_m,
                                                                     const Eigen::Vector3d& velocity_m_s);

/// A ball that falls, and returns from the floor (y of the world, which points down) with that share of its speed.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> bouncing_ball(const Eigen::Vector3d& from_m,
                                                                       const Eigen::Vector3d& velocity_m_s,
                                                                       double floor_m, double restitution);

/// A path by white acceleration of ConstantVelocity{sigma_a}, drawn every 0.05 s and straight between.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> drawn_path(const Eigen::Vector3d& start_m, double sigma_a_m_s2,
                                                                    double duration_s, std::uint64_t seed);

/// All observations in order of arrival; images without the target in them are not there. Same seed, same observations.
[[nodiscard]] std::vector<SimulatedObservation> simulate_track(const TrackScene& scene, std::uint64_t seed);

}  // namespace alidade
