#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/track/track_report.h"
#include "alidade/track/tracker.h"
#include "alidade/track/xiahou_filter.h"

namespace alidade {

/// How observations are tracked and judged.
struct FollowConfig {
  TrackerConfig tracker;
  bool find_sigma_a = true;  ///< Use the σ_a that makes the innovations most probable, not that of the tracker.
  /// Use σ_px from the innovations if they contradict that of the tracker; only if the track is judged.
  bool find_sigma_px = true;
  double predict_s = 0.0;      ///< Above 0: also predict this far ahead of each step.
  double smooth_s = 0.0;       ///< Above 0: also smoothed, with observations up to that much later; not for imm.
  double sigma_clock_s = 0.0;  ///< Above 0: σ of a delay of all heads' angles, included if the track is judged.
  double warm_up_s = 0.5;      ///< After the start of a track: excluded from errors and statistics.
  bool judge = true;           ///< Test the innovations, increase σ accordingly, and test for faults of the rig.
  /// Rows to exclude, one flag per observation; none: repeated rows, if the track is judged.
  std::vector<bool> kept_out = {};
  Progress progress = {};  ///< Called now and then; may stop the work.
};

/// The tracker's config, with the history length that smoothing needs.
[[nodiscard]] TrackerConfig with_history(const FollowConfig& config);

/// Tracks a target through all observations, in order of arrival.
[[nodiscard]] TrackReport track_target(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const FollowConfig& config, const TrueTrack& truth = {},
                                       const TrackWatch& watch = {});

/// The innovations of each head, for the steps after the warm-up.
[[nodiscard]] std::vector<HeadInnovations> test_innovations(std::span<const TargetObservation> observations,
                                                            std::span<const RigHead> heads,
                                                            std::span<const TrackStep> steps,
                                                            const FollowConfig& config);

/// The same with the filter of Xiahou et al.: its steps have a position and σ, and no innovations.
[[nodiscard]] TrackReport track_target_xiahou(std::span<const TargetObservation> observations,
                                              std::span<const RigHead> heads, const XiahouConfig& config,
                                              const TrueTrack& truth = {}, const TrackWatch& watch = {});

/// NEES: (x − truth)ᵀ P⁻¹ (x − truth) of a step's position; NaN if there is no belief or no truth.
[[nodiscard]] double position_nees(const TrackStep& step, const TrueTrack& truth);

/// Lower bound of σ of the position (root of the trace) after each observation, for any estimator on average and a
/// target with white acceleration along this path: posterior Cramér–Rao bound of this trajectory. The information of
/// the observations is taken at the truth. Tichavský, Muravchik & Nehorai, 1998, with one trajectory.
[[nodiscard]] std::vector<double> track_bound(std::span<const TargetObservation> observations,
                                              std::span<const RigHead> heads, const FollowConfig& config,
                                              const TrueTrack& truth);

/// Whether the track is accepted; if not, whether swapped heads or angles in degrees would explain it.
[[nodiscard]] Verdict track_verdict(const TrackReport& report, std::span<const TargetObservation> observations,
                                    std::span<const RigHead> heads, const FollowConfig& config);

}  // namespace alidade
