#pragma once

#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/config_error.h"
#include "alidade/estimation/progress.h"
#include "alidade/pantilt/rig.h"
#include "alidade/public.h"
#include "alidade/track/config.h"
#include "alidade/track/track_report.h"

/// A target followed in space through the pixels of two or more pan-tilt heads: the whole job, as `alidade track` does
/// it. Its result has the path with its covariances, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From observations in order of arrival, of the heads of `rig`. Where the rig has courses of intrinsics
/// (`rig.lens_courses`), each observation is taken with the lens of its time. With the true path there are errors, NEES
/// and the bound. `watch` is shown each observation as it is followed. Throws ConfigError for a config, a rig or
/// observations that cannot be, Interrupted where `progress` says stop; never for what the observations show.
[[nodiscard]] TargetTrack track(std::vector<TargetObservation> observations, Rig rig, const TrackConfig& config = {},
                                TrueTrack truth = {}, const Progress& progress = {}, const TrackWatch& watch = {});

/// The observation of which a head's course of intrinsics says nothing, in a sentence; empty where there is none.
[[nodiscard]] std::string lens_course_fault(const std::vector<TargetObservation>& observations, const Rig& rig);

/// The same one observation at a time, for heads that are followed while they move. An observation comes with its own
/// `lens` where the camera zooms: a rig with courses of intrinsics is a recording, and refused.
class TargetTracker {
 public:
  /// Throws ConfigError for a config or a rig that cannot be.
  explicit TargetTracker(Rig rig, const TrackConfig& config = {});
  ~TargetTracker();
  TargetTracker(TargetTracker&&) noexcept;
  TargetTracker& operator=(TargetTracker&&) noexcept;

  /// What became of it. With `sigma_a_m_s2` given, the belief is that of the batch call on the same observations, whose
  /// σ is increased at the end where the innovations require it; without, 1 m/s² is taken until the end. Throws
  /// ConfigError for an observation that cannot be, which is then not taken.
  TrackStep push(const TargetObservation& observation);
  /// Where the target will be at a time. None before the start, before the newest observation, or of xiahou2015.
  [[nodiscard]] std::optional<PredictedStep> at(double t_s) const;
  /// All that has been pushed, as track() gives it; of a stream that is longer than `keep_rows` the newest, and it says
  /// so.
  [[nodiscard]] TargetTrack finish(const TrueTrack& truth = {}, const Progress& progress = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
