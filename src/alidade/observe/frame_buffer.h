#pragma once

#include <vector>

#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

/// The last frames, with normalised pixels, in preallocated memory. When it is full every second frame is dropped.
/// A point that slipped, or was last seen before a gap, continues as a new point.
class FrameBuffer {
 public:
  FrameBuffer(std::size_t num_points, std::size_t capacity);

  /// Adds a frame; `px` normalised, NaN: not seen or not to be used.
  void add(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  void renew_point(std::size_t point) { ++generation_[point]; }  ///< From the next frame on it is another point.
  void renew_all();
  void erase_before(double t_s);
  void clear();

  [[nodiscard]] std::size_t size() const { return frames_.size(); }
  [[nodiscard]] std::size_t num_points() const { return num_points_; }
  [[nodiscard]] double duration_s() const { return frames_.empty() ? 0.0 : frames_.back().t_s - frames_.front().t_s; }
  [[nodiscard]] const std::vector<RotationFrame>& frames() const { return frames_; }
  [[nodiscard]] const Eigen::Vector2d& px(std::size_t frame, std::size_t point) const {
    return px_[frame * num_points_ + point];
  }
  [[nodiscard]] int generation(std::size_t frame, std::size_t point) const {
    return generations_[frame * num_points_ + point];
  }
  [[nodiscard]] int current_generation(std::size_t point) const { return generation_[point]; }

 private:
  void thin();

  std::size_t num_points_, capacity_;
  std::vector<RotationFrame> frames_;  ///< Without px.
  std::vector<Eigen::Vector2d> px_;
  std::vector<int> generations_, generation_;
};

/// A bundle over a buffer.
struct AdjustConfig {
  ObserveNuisances nuisances;
  bool with_depth = false;
  double sigma_px = 0.0;  ///< Normalised; 0: estimated from the residuals.
  double sigma_range_m = 0.0;
  std::size_t range_point = 0;
  double sigma_rotation_rad = 0.0;
  double sigma_rate_rad_per_s = 0.0;
  bool reject = true;                ///< Reject what lies beyond 6 σ.
  std::optional<CommonPrior> prior;  ///< None: a weak one about wherever the answer is.
  RotatingCamera start;
  /// fx = fy to try one after the other beside the start's, normalised.
  std::vector<double> other_starts;
  int max_iterations = 60;  ///< From each start: one that is near the answer is there after a dozen.
  bool gives_up = false;    ///< What does not seem to settle is no answer; for what is compared by its noise alone.
};

struct Adjustment {
  bool has_value = false;
  BundleSolution solution;
  RotationBundle bundle;
  std::vector<int> bundle_point_of;  ///< Of each of the buffer's points as it is now; −1: none.
  double sigma_px = 0.0;             ///< Normalised; given, or estimated.
  std::size_t num_rejected = 0;
};

/// Adjusts all that the buffer holds. No value: fewer measurements than unknowns, or no start leads anywhere.
[[nodiscard]] Adjustment adjust(const FrameBuffer& buffer, const AdjustConfig& config, const Progress& progress = {});

}  // namespace alidade
