#pragma once

#include <Eigen/Core>
#include <memory>
#include <span>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/intrinsics_history.h"

namespace alidade {

/// On-line observer of a head's lens: static points in its images, and the encoder readings, are processed
/// by the hybrid observer (observe/filters/hybrid.h) image by image; its result are the focal lengths of that
/// image, with the camera's own principal point.
class LensObserver {
 public:
  /// `head` with the initial camera: its σ, or a typical one if it states none, is the prior.
  /// `sigma_encoder_rad`: of a reading.
  LensObserver(const RigHead& head, std::size_t num_points, double sigma_encoder_rad);
  ~LensObserver();
  LensObserver(LensObserver&&) noexcept;
  LensObserver& operator=(LensObserver&&) noexcept;

  /// Pixels of the points in the image taken at that time, NaN: not visible. Images in order of capture.
  void take(double t_capture_s, const Eigen::Vector2d& pan_tilt_rad, std::span<const Eigen::Vector2d> px);
  /// From the last image; the camera's own before the first estimate.
  [[nodiscard]] const IntrinsicsSample& lens() const;
  [[nodiscard]] bool has_estimate() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace alidade
