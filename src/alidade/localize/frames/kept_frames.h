#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "alidade/localize/localization.h"
#include "alidade/localize/sequence.h"
#include "alidade/localize/target.h"

namespace alidade {

/// The frames that are solved for together at the end: all; once there are more than `most`, every second, fourth, …,
/// so that memory and the time at the end do not grow with the recording.
class KeptFrames {
 public:
  explicit KeptFrames(std::size_t most) : max_(most) {}

  void add(ObservationFrame frame);
  [[nodiscard]] const std::vector<ObservationFrame>& frames() const { return frames_; }
  /// One of so many is kept, the first among them.
  [[nodiscard]] std::size_t stride() const { return stride_; }
  /// Of a frame of the recording: the first one kept from there on; the last one kept where there is none.
  [[nodiscard]] std::size_t index_of(std::size_t frame) const;
  /// The steps of a path that are of frames kept.
  [[nodiscard]] std::vector<PathStep> steps(std::span<const PathStep> path) const;
  /// The poses of `path`, which the filter followed, where those kept are `solved`: between two of them as the filter
  /// went, with what that is off at the second one shared out over the time between.
  void put_back(std::span<const PathStep> solved, std::vector<PathStep>& path) const;
  /// Means over stretches of `num_each` of these frames, of a camera that stands still: between two of them it is where
  /// they say, and not where a filter went.
  [[nodiscard]] KeptFrames averaged(std::vector<ObservationFrame> means, std::size_t num_each) const;
  /// One of so many of these; with the observations of known points alone where some are given.
  [[nodiscard]] KeptFrames every(std::size_t num, std::span<const KnownPoint> alone) const;

 private:
  std::size_t max_, stride_ = 1, num_given_ = 0;
  bool is_still_ = false;
  std::vector<ObservationFrame> frames_;
};

}  // namespace alidade
