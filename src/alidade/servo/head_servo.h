#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/intrinsics_history.h"
#include "alidade/servo/axis/axis_controller.h"
#include "alidade/servo/identify/search.h"

namespace alidade {

/// The target's position in an image, and the encoders' readings at its capture.
struct HeadObservation {
  double t_capture_s = 0.0;
  Eigen::Vector2d pan_tilt_rad = Eigen::Vector2d::Zero();
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  /// Intrinsics of that image, if they are not the head's own; their σ is included.
  std::optional<IntrinsicsSample> lens = {};
};

struct HeadServoInput {
  double t_s = 0.0;
  Eigen::Vector2d encoder_rad = Eigen::Vector2d::Zero();  ///< (pan, tilt) now.
  std::optional<HeadObservation>
      observation;  ///< From the image that arrived since the last step, if it shows the target.
};

struct HeadServoOutput {
  Eigen::Vector2d command = Eigen::Vector2d::Zero();    ///< (pan, tilt), in the plants' units of command.
  Eigen::Vector2d asked_rad = Eigen::Vector2d::Zero();  ///< Where the head should point when the command takes effect.
  Eigen::Vector2d predicted_rad = Eigen::Vector2d::Zero();  ///< The predicted position of the target now.
  Eigen::Vector2d sigma_rad = Eigen::Vector2d::Zero();
  bool has_prediction = false;
  ServoEvent event = ServoEvent::waiting;
};

/// Keeps the target in the centre of one head's image: delayed images and current encoder readings in, commands out,
/// once per period. All memory is allocated at the start; a step allocates nothing. docs/maths/servo.md
class HeadServo {
 public:
  HeadServo(const RigHead& head, const ServoConfig& config);

  HeadServoOutput step(const HeadServoInput& input);
  /// Readings at which the ray of a pixel would be at the image centre: the measured bearing. None if
  /// the lens model has no ray for it.
  [[nodiscard]] std::optional<Eigen::Vector2d> bearing_of(const HeadObservation& observation) const;

 private:
  ObservationUse take(const HeadObservation& observation);
  [[nodiscard]] std::array<LensEffect, 2> lens_effects(const HeadObservation& observation) const;
  ServoEvent follow(const HeadServoInput& input);
  /// Position of the target, or of the search, when a command sent now takes effect, on each axis after its own delay.
  void ask_for_target(double now_s, std::array<AxisInput, 2>& inputs) const;
  void ask_for_search(double now_s, std::array<AxisInput, 2>& inputs) const;

  RigHead head_;
  ServoConfig config_;
  Eigen::Vector2d centre_px_;
  double focal_px_, sigma_bearing_rad_;
  BearingFilter filter_;
  TargetSearch search_;
  std::array<AxisController, 2> axes_;
  Eigen::Vector2d error_rad_ = Eigen::Vector2d::Zero();
  double last_seen_s_ = 0.0;
  bool is_lost_ = false;
};

/// Principal point, and focal length (mean of both). [px]
[[nodiscard]] Eigen::Vector2d centre_of(const Camera& camera);
[[nodiscard]] double focal_of(const Camera& camera);

}  // namespace alidade
