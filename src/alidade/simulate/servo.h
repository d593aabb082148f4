#pragma once

#include <Eigen/Core>
#include <array>
#include <cstdint>
#include <optional>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/positioner.h"
#include "alidade/pantilt/servo_plant.h"
#include "alidade/simulate/draws.h"
#include "alidade/simulate/target_path.h"

namespace alidade {

/// The truth of a head: two axes that respond late and differ from their model, encoders with rounding and errors, and
/// a camera with noise on the target's pixel.
struct HeadTruth {
  RigHead head;
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt)
  double encoder_step_rad = 0.0;    ///< One count; 0: no rounding.
  double sigma_encoder_rad = 0.0008726646259971648;
  double sigma_px = 0.5;
  std::vector<Eigen::Vector3d> background_in_world = {};  ///< Distant static points.
};

/// The moving head. Same seed, same noise. It allocates nothing after construction.
class SimulatedHead {
 public:
  SimulatedHead(const HeadTruth& truth, const Eigen::Vector2d& pan_tilt_rad, std::uint64_t seed);

  void send(const Eigen::Vector2d& command);
  void advance(double dt_s);
  [[nodiscard]] Eigen::Vector2d read_encoders();
  /// Pixel of the target in an image taken now: without noise, also outside the image if in front of the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> true_pixel(const Eigen::Vector3d& target_in_world) const;
  /// The same a time dt ≥ 0 later, under the commands already sent; the head itself is not advanced.
  [[nodiscard]] std::optional<Eigen::Vector2d> true_pixel_after(double dt_s,
                                                                const Eigen::Vector3d& target_in_world) const;
  /// `true_pixel` with noise, if it lies within the image.
  [[nodiscard]] std::optional<Eigen::Vector2d> seen_pixel(const Eigen::Vector3d& target_in_world);
  /// Pixels of the background in that image, with noise; NaN: not in it.
  [[nodiscard]] std::vector<Eigen::Vector2d> seen_background();
  /// Sets the focal lengths to this factor of the camera's own.
  void zoom_to(double factor);
  /// The present intrinsics.
  [[nodiscard]] const Eigen::Vector4d& intrinsics() const { return intrinsics_; }
  [[nodiscard]] Eigen::Vector2d angles_rad() const;
  [[nodiscard]] Eigen::Vector2d rates_rad_s() const;

 private:
  [[nodiscard]] std::optional<Eigen::Vector2d> pixel_at(const Eigen::Vector2d& angles_rad,
                                                        const Eigen::Vector3d& target_in_world) const;

  HeadTruth truth_;
  std::array<DelayedAxis, 2> axes_;
  Draws draws_, background_draws_;
  Eigen::Vector4d intrinsics_;
};

/// A log for `alidade identify`: one axis under steps of several sizes in both directions, or a chirp.
struct ServoLogScene {
  ServoAxis axis;
  Mode mode = {};  ///< A flexible mode behind the axis.
  bool is_chirp = false;
  double amplitude = 200.0;  ///< Amplitude of the command.
  double duration_s = 5.0, rate_hz = 100.0;
  int commands_per_row =
      1;  ///< Commands change so many times from row to row; a row has the command that is valid from then on.
  double step_at_s = 0.5, hold_s = 0.9;                   ///< Time of the first step, and interval between steps.
  std::vector<double> steps{1.0, -0.5, 0.25, -1.0, 0.5};  ///< In amplitudes, repeated; one: it is kept.
  double low_hz = 0.1, high_hz = 3.0;                     ///< Frequencies of the chirp.
  double max_command = 0.0;                               ///< Larger commands act like this one; 0: no limit.
  double rate_offset_rad_s = 0.0;                         ///< Rotation rate in addition to the commanded one.
  double soft_max_rate_rad_s = 0.0;                       ///< A rate r becomes r / (1 + |r| / this); 0: by the lag.
  double zero_rad = 0.0;                                  ///< Reading of the encoder at angle zero.
  double sigma_rad = 0.0008726646259971648, encoder_step_rad = 0.0;
};
struct ServoLogRow {
  double t_s = 0.0, command = 0.0, angle_rad = 0.0;
};
[[nodiscard]] std::vector<ServoLogRow> simulate_servo_log(const ServoLogScene& scene, std::uint64_t seed);

}  // namespace alidade
