#pragma once

#include <vector>

#include "alidade/observe/intrinsics_estimate.h"
#include "alidade/observe/solve/rotation_bundle.h"

namespace alidade {

/// The last frames, with normalised pixels, in preallocated memory. When it is full, every second frame is dropped.
/// An outlier point, or one that was last seen before a gap, continues as a new point.
class FrameBuffer {
 public:
  FrameBuffer(std::size_t num_points, std::size_t capacity);

  /// Adds a frame; `px` is normalised; NaN: not seen or not to be used.
  void add(const RotationFrame& frame, std::span<const Eigen::Vector2d> px);
  void renew_point(std::size_t point) { ++generation_[point]; }  ///< From the next frame on it is a new point.
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
  std::vector<RotationFrame> frames_;  ///< Without their px.
  std::vector<Eigen::Vector2d> px_;
  std::vector<int> generations_, generation_;
};

/// Options of a bundle adjustment over a buffer.
struct AdjustConfig {
  ObserveNuisances nuisances;
  bool with_depth = false;
  double sigma_px = 0.0;  ///< Normalised; 0: estimated from the residuals.
  double sigma_range_m = 0.0;
  std::size_t range_point = 0;
  double sigma_rotation_rad = 0.0;
  double sigma_rate_rad_per_s = 0.0;
  bool reject = true;                ///< Reject observations beyond 6 σ.
  std::optional<CommonPrior> prior;  ///< None: a weak one, centred on each guess.
  RotatingCamera start;
  /// Further initial guesses of fx = fy besides `start`, normalised, tried one after the other.
  std::vector<double> other_starts;
  int max_iterations = 60;  ///< From each initial guess: a good one converges within a dozen.
  bool gives_up = false;    ///< Stop if convergence seems unlikely: for comparing solutions by their noise.
};

struct Adjustment {
  bool has_value = false;
  BundleSolution solution;
  RotationBundle bundle;
  std::vector<int> bundle_point_of;  ///< Per current point of the buffer, its index in the bundle; −1: none.
  double sigma_px = 0.0;             ///< Normalised; given or estimated.
  std::size_t num_rejected = 0;
};

/// Adjusts all frames of the buffer. No value: fewer measurements than unknowns, or no initial guess converges.
[[nodiscard]] Adjustment adjust(const FrameBuffer& buffer, const AdjustConfig& config, const Progress& progress = {});

}  // namespace alidade
