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
  /// Intrinsics of that image, where they are not the head's own; their σ is included.
  std::optional<IntrinsicsSample> lens = {};
};

struct HeadServoInput {
  double t_s = 0.0;
  Eigen::Vector2d encoder_rad = Eigen::Vector2d::Zero();  ///< (pan, tilt) now.
  std::optional<HeadObservation>
      observation;  ///< Of the image that arrived since the last step, if the target is in it.
};

struct HeadServoOutput {
  Eigen::Vector2d command = Eigen::Vector2d::Zero();        ///< (pan, tilt), in the plants' units of command.
  Eigen::Vector2d asked_rad = Eigen::Vector2d::Zero();      ///< Where the head should point when the command acts.
  Eigen::Vector2d predicted_rad = Eigen::Vector2d::Zero();  ///< The target's predicted position now.
  Eigen::Vector2d sigma_rad = Eigen::Vector2d::Zero();
  bool has_prediction = false;
  ServoEvent event = ServoEvent::waiting;
};

/// Keeps the target in the centre of one head's image: late images and present encoder readings in, commands out,
/// once a period. Everything is allocated at the start; a step allocates nothing. docs/maths/servo.md
class HeadServo {
 public:
  HeadServo(const RigHead& head, const ServoConfig& config);

  HeadServoOutput step(const HeadServoInput& input);
  /// Readings at which the head would have a pixel's ray in the centre of its image: the measured bearing. None where
  /// the lens has no ray there.
  [[nodiscard]] std::optional<Eigen::Vector2d> bearing_of(const HeadObservation& observation) const;

 private:
  ObservationUse take(const HeadObservation& observation);
  [[nodiscard]] std::array<LensEffect, 2> lens_effects(const HeadObservation& observation) const;
  ServoEvent follow(const HeadServoInput& input);
  /// Where it, or the search, is when a command of now acts, on each axis after its own delay.
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

/// Where the optical axis meets the image, and the focal length (mean of both). [px]
[[nodiscard]] Eigen::Vector2d centre_of(const Camera& camera);
[[nodiscard]] double focal_of(const Camera& camera);

}  // namespace alidade
