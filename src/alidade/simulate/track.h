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

/// A time interval in which a head does not see the target.
struct Occlusion {
  std::size_t head;
  double from_s, to_s;
};

/// Deviations of a rig, its clocks and its images from its file. With two heads they apply to the second one, except
/// for the zeros.
struct TrackFaults {
  Eigen::Vector3d base_turn_rad = Eigen::Vector3d::Zero();  ///< Base rotation about x (pitch), y (yaw), z (roll).
  double baseline = 0.0;                                    ///< Relative increase of its distance.
  std::array<Eigen::Vector2d, 2> zero_rad{Eigen::Vector2d::Zero(),
                                          Eigen::Vector2d::Zero()};  ///< (pan, tilt), one per head.
  double clock_s = 0.0;                                              ///< Excess of its time stamps over the true times.
  double time_step_s =
      0.0;  ///< Above 0: times of all heads are rounded down to its multiples; of equal times the first is kept.
  double clutter = 0.0;       ///< Share of the observations, of both heads, at random positions in the image.
  double second = 0.0;        ///< Share of the observations of another target, 0.4 m to the right and 0.1 m above.
  bool swapped = false;       ///< The heads' names are exchanged.
  bool mirrored = false;      ///< Its images are mirrored, left to right.
  bool mirrored_all = false;  ///< The images of all heads are mirrored.
  bool milliseconds = false;  ///< All times are in milliseconds.
  bool milliseconds_of_one = false;          ///< Its times are in milliseconds.
  bool pan_sign = false, tilt_sign = false;  ///< Its angles have the opposite sign.
};

/// A world for `track`: the path of a target, and heads that follow it, each with a first-order lag.
struct TrackScene {
  std::string name;
  std::vector<RigHead> heads;
  std::function<Eigen::Vector3d(double t_s)> position;  ///< Position in the world. [m]
  double duration_s = 10.0;
  std::vector<double> rate_hz;         ///< Image rate, one per head.
  std::vector<double> phase_s;         ///< Time of the first image, one per head.
  double latency_s = 0.0;              ///< From capture to arrival.
  std::vector<double> more_latency_s;  ///< Additional latency, one per head; empty: none.
  double aiming_lag_s = 0.34;          ///< Time constant of the heads. 0: they always point at the target.
  double sigma_px = 0.5, sigma_encoder_rad = 0.0008726646259971648;
  double sigma_a_m_s2 = 1.0;  ///< The value that a filter should use for the target.
  std::vector<Occlusion> occlusions;
  TrackFaults faults;
};

/// One image of one head: the encoders' readings at its capture, and the pixel of the target.
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

/// Offset from the start of a circle in a plane of constant z, which begins at +x of its centre.
[[nodiscard]] Eigen::Vector3d circle_offset(double radius_m, double period_s, double t_s);

/// The manoeuvre of scenario C: 11 s between 0.9 and 3.9 m, up to 1.5 m/s and 6 m/s².
[[nodiscard]] Eigen::Vector3d manoeuvre_position(double t_s);

/// A ball that rests at a point for a second, is thrown with this velocity, and is caught and held when it returns to
/// its height.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> thrown_ball(const Eigen::Vector3d& from_m,
                                                                     const Eigen::Vector3d& velocity_m_s);

/// A ball that falls and rebounds from the floor (y of the world, pointing down) with that share of its speed.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> bouncing_ball(const Eigen::Vector3d& from_m,
                                                                       const Eigen::Vector3d& velocity_m_s,
                                                                       double floor_m, double restitution);

/// A random path with white acceleration of ConstantVelocity{sigma_a}, drawn every 0.05 s, linear between.
[[nodiscard]] std::function<Eigen::Vector3d(double t_s)> drawn_path(const Eigen::Vector3d& start_m, double sigma_a_m_s2,
                                                                    double duration_s, std::uint64_t seed);

/// All observations in order of arrival; images without the target are omitted. Same seed, same observations.
[[nodiscard]] std::vector<SimulatedObservation> simulate_track(const TrackScene& scene, std::uint64_t seed);

}  // namespace alidade
