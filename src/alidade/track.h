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

/// From observations in order of arrival, of the heads of `rig`. Where the rig has
/// `intrinsics_histories`, each observation is taken with the intrinsics of its time. With the true path there are
/// errors, NEES and the bound. `watch` is called with each observation. Throws ConfigError for an invalid config, rig
/// or observation, Interrupted where `progress` returns false; never for what the observations show.
[[nodiscard]] TargetTrack track(std::vector<TargetObservation> observations, Rig rig, const TrackConfig& config = {},
                                TrueTrack truth = {}, const Progress& progress = {}, const TrackWatch& watch = {});

/// Names the first observation that lies outside the time span of its head's intrinsics; empty where there is none.
[[nodiscard]] std::string intrinsics_history_fault(const std::vector<TargetObservation>& observations, const Rig& rig);

/// The same, incrementally, one observation at a time. Where the camera zooms each observation has its own `lens`: a
/// rig with `intrinsics_histories` is refused, since these are of recordings.
class TargetTracker {
 public:
  /// Throws ConfigError for an invalid config or rig.
  explicit TargetTracker(Rig rig, const TrackConfig& config = {});
  ~TargetTracker();
  TargetTracker(TargetTracker&&) noexcept;
  TargetTracker& operator=(TargetTracker&&) noexcept;

  /// What became of it. With `sigma_a_m_s2` and `sigma_px` given, the belief is that of the batch call on the same
  /// observations, whose σ is increased at the end where the innovations require it, and which keeps out rows that
  /// repeat; without, 1 m/s² and 0.5 px are used until the end. Throws ConfigError for an invalid observation, which is
  /// then not added.
  TrackStep push(const TargetObservation& observation);
  /// Predicted state at a time. None before the track begins, before the newest observation, or with xiahou2015.
  [[nodiscard]] std::optional<PredictedStep> at(double t_s) const;
  /// What track() returns for all observations pushed; of a stream longer than `keep_rows` for the newest, and the
  /// result says so.
  [[nodiscard]] TargetTrack finish(const TrueTrack& truth = {}, const Progress& progress = {}) const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
