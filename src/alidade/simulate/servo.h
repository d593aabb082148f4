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

/// A head as it is: two axes that obey late and never quite as known, encoders that round and err, a camera with noise
/// on the target's pixel.
struct HeadTruth {
  RigHead head;
  std::array<ServoAxis, 2> axes{};  ///< (pan, tilt)
  double encoder_step_rad = 0.0;    ///< Of one count; 0: none.
  double sigma_encoder_rad = 0.0008726646259971648;
  double sigma_px = 0.5;
  std::vector<Eigen::Vector3d> background_in_world = {};  ///< Distant static points.
};

/// It moves. Same seed, same noise. Allocates nothing once made.
class SimulatedHead {
 public:
  SimulatedHead(const HeadTruth& truth, const Eigen::Vector2d& pan_tilt_rad, std::uint64_t seed);

  void send(const Eigen::Vector2d& command);
  void advance(double dt_s);
  [[nodiscard]] Eigen::Vector2d read_encoders();
  /// Where the target is in the image taken now: without noise, anywhere in front of the camera.
  [[nodiscard]] std::optional<Eigen::Vector2d> true_pixel(const Eigen::Vector3d& target_in_world) const;
  /// The same dt ≥ 0 later, under the commands that were sent; the head itself stays.
  [[nodiscard]] std::optional<Eigen::Vector2d> true_pixel_after(double dt_s,
                                                                const Eigen::Vector3d& target_in_world) const;
  /// The same as `true_pixel` with noise, where it is within the image.
  [[nodiscard]] std::optional<Eigen::Vector2d> seen_pixel(const Eigen::Vector3d& target_in_world);
  /// Where the background is in that image, with noise; NaN: not in it.
  [[nodiscard]] std::vector<Eigen::Vector2d> seen_background();
  /// From now on the focal lengths are so many times the camera's own.
  void zoom_to(double factor);
  /// Intrinsics as they are.
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

/// A log as `alidade identify` reads it: one axis under steps of several sizes to both sides, or a chirp.
struct ServoLogScene {
  ServoAxis axis;
  Mode mode = {};  ///< What swings behind it.
  bool is_chirp = false;
  double amplitude = 200.0;  ///< Of the command.
  double duration_s = 5.0, rate_hz = 100.0;
  int commands_per_row =
      1;  ///< Commands change so often from row to row; a row has the one that is valid from then on.
  double step_at_s = 0.5, hold_s = 0.9;                   ///< The first step, and each until the next.
  std::vector<double> steps{1.0, -0.5, 0.25, -1.0, 0.5};  ///< Of the amplitude, over and over; one: it stays.
  double low_hz = 0.1, high_hz = 3.0;                     ///< Of the chirp.
  double max_command = 0.0;                               ///< Larger ones act as it; 0: none do.
  double rate_offset_rad_s = 0.0;                         ///< It turns by so much beside what it is commanded.
  double soft_max_rate_rad_s = 0.0;                       ///< Rates r are r / (1 + |r| / this); 0: as its lag has them.
  double zero_rad = 0.0;                                  ///< What the encoder reads at angle zero.
  double sigma_rad = 0.0008726646259971648, encoder_step_rad = 0.0;
};
struct ServoLogRow {
  double t_s = 0.0, command = 0.0, angle_rad = 0.0;
};
[[nodiscard]] std::vector<ServoLogRow> simulate_servo_log(const ServoLogScene& scene, std::uint64_t seed);

}  // namespace alidade
