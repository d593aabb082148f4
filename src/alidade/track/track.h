#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/track/rig_faults.h"
#include "alidade/track/tracker.h"
#include "alidade/track/xiahou_filter.h"

namespace alidade {

struct TrackConfig {
  TrackerConfig tracker;
  bool find_sigma_a = true;  ///< Take the σ_a that makes the innovations most probable, not the tracker's.
  double predict_s = 0.0;    ///< Above 0: a prediction so far ahead of each step.
  double smooth_s = 0.0;  ///< Above 0: also what the observations until so long after tell of each moment; not for imm.
  double warm_up_s = 0.5;  ///< After the start of a track: not counted in errors and statistics.
  bool judge = true;       ///< Test the innovations, raise σ by what they ask for, and ask for faults of the rig.
};

/// Where the target will be, or was.
struct PredictedStep {
  double t_s = 0.0;
  bool has_belief = false;
  Belief<6> belief;
};

/// What the innovations of one head tell, each scaled to σ = 1: where all holds they are white, with mean zero wherever
/// the target is and however it moves. Those left out by the gate count, at the gate.
struct HeadInnovations {
  std::size_t num = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();   ///< In u, v.
  double along = 0.0;                               ///< Mean along the target's motion in the image.
  Eigen::Vector2d place = Eigen::Vector2d::Zero();  ///< Slope over (u, v) − centre, a quarter of the image the unit.
  double place_num = 0.0;                           ///< Σ x² behind the slope: its σ is 1/√ of it.
  double colour = 0.0;                              ///< Correlation with the one before.
  double nis_per_dof = 0.0;
};

/// What became of all observations, and how good it is.
struct TrackReport {
  double sigma_a_m_s2 = 0.0;
  bool sigma_a_is_found = false;
  std::vector<TrackStep> steps;         ///< One an observation, in their order.
  std::vector<PredictedStep> ahead;     ///< One a step, or none.
  std::vector<PredictedStep> smoothed;  ///< In order of time, one a capture time that was told of; else none.
  std::size_t num_used = 0, num_starts = 0, num_restarts = 0;
  double log_likelihood = 0.0;  ///< Of all innovations, but for a constant.
  /// With truth, after the warm-up; NaN without.
  double rms_m = std::numeric_limits<double>::quiet_NaN();
  double mean_error_m = std::numeric_limits<double>::quiet_NaN();
  double nees_per_dof = std::numeric_limits<double>::quiet_NaN();
  double smoothed_rms_m = std::numeric_limits<double>::quiet_NaN();
  double pcrlb_m = std::numeric_limits<double>::quiet_NaN();
  double nis_per_dof =
      std::numeric_limits<double>::quiet_NaN();  ///< Of the used observations; gated ones count at the gate.
  std::vector<double> nees;                      ///< One a step; NaN where there is no truth.
  /// Of a filter that learns the rig's errors where they are counted: with them counted alone, innovations are coloured
  /// by what does not change. One a head.
  std::vector<HeadInnovations> innovations;
  double inflation = 1.0;           ///< Every covariance was raised by this factor: what the innovations ask for.
  std::vector<RigFault> faults;     ///< The most surprising first.
  bool errors_are_counted = false;  ///< Those of the rig.
};

/// Is shown each observation with what became of it, as it is followed. What it throws ends the work.
using TrackWatch = std::function<void(const TargetObservation&, const TrackStep&)>;

/// Follows a target through all observations, in order of arrival.
[[nodiscard]] TrackReport track_target(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const TrackConfig& config, const TrueTrack& truth = {},
                                       const TrackWatch& watch = {});

/// The innovations of each head, of the steps after the warm-up.
[[nodiscard]] std::vector<HeadInnovations> test_innovations(std::span<const TargetObservation> observations,
                                                            std::span<const RigHead> heads,
                                                            std::span<const TrackStep> steps,
                                                            const TrackConfig& config);

/// The same by the filter of Xiahou et al.: its steps have a position and σ, and no innovations.
[[nodiscard]] TrackReport track_target_xiahou(std::span<const TargetObservation> observations,
                                              std::span<const RigHead> heads, const XiahouConfig& config,
                                              const TrueTrack& truth = {}, const TrackWatch& watch = {});

/// (x − truth)ᵀ P⁻¹ (x − truth) of a step's position; NaN where there is no belief or no truth.
[[nodiscard]] double position_nees(const TrackStep& step, const TrueTrack& truth);

/// σ of the position (root of the trace) after each observation that no estimator can undercut on average, for a target
/// that moves by white acceleration along this path: posterior Cramér–Rao bound of this trajectory. The information
/// of the observations is taken at the truth. Tichavský, Muravchik & Nehorai, 1998, with one trajectory.
[[nodiscard]] std::vector<double> track_bound(std::span<const TargetObservation> observations,
                                              std::span<const RigHead> heads, const TrackConfig& config,
                                              const TrueTrack& truth);

/// Whether the track stands; where it does not, whether swapped heads or angles in degrees would explain it.
[[nodiscard]] Verdict track_verdict(const TrackReport& report, std::span<const TargetObservation> observations,
                                    std::span<const RigHead> heads, const TrackConfig& config);

}  // namespace alidade
