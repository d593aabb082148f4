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

/// Tracking of a target in 3-D through the pixels of two or more pan-tilt heads: the whole job, as `alidade track` does
/// it. The result contains the path with its covariances, what was rejected and why, and a verdict.
namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// From observations in order of arrival by the heads of `rig`. If the rig has
/// `intrinsics_histories`, each observation uses the intrinsics of its capture time. With the true path, errors, NEES
/// and the bound are computed. `watch` is called with each observation. Throws ConfigError for an invalid config, rig
/// or observation, Interrupted where `progress` returns false; never because of what the observations show.
[[nodiscard]] TargetTrack track(std::vector<TargetObservation> observations, Rig rig, const TrackConfig& config = {},
                                TrueTrack truth = {}, const Progress& progress = {}, const TrackWatch& watch = {});

/// Names the first observation outside the time span of its head's intrinsics; empty if there is none.
[[nodiscard]] std::string intrinsics_history_fault(const std::vector<TargetObservation>& observations, const Rig& rig);

/// The same, incrementally, one observation at a time. If a camera zooms, each observation carries its own `lens`: a
/// rig with `intrinsics_histories` is rejected, because these come from recordings.
class TargetTracker {
 public:
  /// Throws ConfigError for an invalid config or rig.
  explicit TargetTracker(Rig rig, const TrackConfig& config = {});
  ~TargetTracker();
  TargetTracker(TargetTracker&&) noexcept;
  TargetTracker& operator=(TargetTracker&&) noexcept;

  /// Returns the result for the observation. With `sigma_a_m_s2` and `sigma_px` given, the belief is that of the batch
  /// call on the same observations; only the batch call increases σ at the end where the innovations require it, and
  /// excludes repeated rows. If they are not given, 1 m/s² and 0.5 px are used until finish(). Throws ConfigError for
  /// an invalid observation, which is then not added.
  TrackStep push(const TargetObservation& observation);
  /// Predicted state at a time. None before the track begins, before the newest observation, or with xiahou2015.
  [[nodiscard]] std::optional<PredictedStep> at(double t_s) const;
  /// What track() returns for all observations pushed so far; for a stream longer than `keep_rows`, for the newest
  /// ones, and the result says so.
  [[nodiscard]] TargetTrack finish(const TrueTrack& truth = {}, const Progress& progress = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
