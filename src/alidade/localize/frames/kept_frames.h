#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/localize/localization.h"
#include "alidade/localize/sequence.h"
#include "alidade/localize/target.h"

namespace alidade {

/// The frames that are solved together at the end: all; beyond `most`, every second, fourth, …, so that memory and the
/// time at the end do not grow with the recording.
class KeptFrames {
 public:
  explicit KeptFrames(std::size_t most) : max_(most) {}

  void add(ObservationFrame frame);
  [[nodiscard]] const std::vector<ObservationFrame>& frames() const { return frames_; }
  /// One in this many frames is kept, the first among them.
  [[nodiscard]] std::size_t stride() const { return stride_; }
  /// Index of the first kept frame at or after a frame of the recording; that of the last one, if there is none.
  [[nodiscard]] std::size_t index_of(std::size_t frame) const;
  /// The steps of a path at kept frames.
  [[nodiscard]] std::vector<PathStep> steps(std::span<const PathStep> path) const;
  /// Replaces the filter's path by the solved poses of kept frames: between two of them it follows the filter's motion,
  /// and the difference at the second one is distributed over the time between.
  void put_back(std::span<const PathStep> solved, std::vector<PathStep>& path) const;
  /// Means over intervals of `num_each` of these frames, for a camera that stands still: between two of them, poses are
  /// interpolated and do not follow the filter.
  [[nodiscard]] KeptFrames averaged(std::vector<ObservationFrame> means, std::size_t num_each) const;
  /// Every `num`-th of these; only with the observations of known points, if `alone` is not empty.
  [[nodiscard]] KeptFrames every(std::size_t num, std::span<const KnownPoint> alone) const;

 private:
  std::size_t max_, stride_ = 1, num_given_ = 0;
  bool is_still_ = false;
  std::vector<ObservationFrame> frames_;
};

}  // namespace alidade
