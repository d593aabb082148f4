#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/intrinsics_history.h"

namespace alidade {

/// The on-line observer of a head's lens: static points in its images, and the encoders' readings, go
/// through the hybrid observer (observe/filters/hybrid.h) image by image; what comes out are the focal lengths of that
/// image, beside the camera's own principal point.
class LensObserver {
 public:
  /// `head` with the initial camera: its σ, or a typical one where it states none, is the prior.
  /// `sigma_encoder_rad`: of a reading.
  LensObserver(const RigHead& head, std::size_t num_points, double sigma_encoder_rad);
  ~LensObserver();
  LensObserver(LensObserver&&) noexcept;
  LensObserver& operator=(LensObserver&&) noexcept;

  /// Pixels of the points in the image taken then, NaN: not seen. Images in order of capture.
  void take(double t_capture_s, const Eigen::Vector2d& pan_tilt_rad, std::span<const Eigen::Vector2d> px);
  /// As of the last image; the camera's own before the first estimate.
  [[nodiscard]] const IntrinsicsSample& lens() const;
  [[nodiscard]] bool has_estimate() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace alidade
