#pragma once

#include <Eigen/Core>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/counts.h"
#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rig.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/public.h"
#include "alidade/track/config.h"
#include "alidade/track/track_step.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Where the target will be, or was.
struct PredictedStep {
  double t_s = 0.0;
  bool has_belief = false;
  Belief<6> belief;
};

/// Statistics of one head's whitened innovations: with a correct model they are white, with mean zero wherever the
/// target is and however it moves. Those rejected by the gate count, scaled to the gate.
struct HeadInnovations {
  std::size_t num = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  ///< In u, v.
  double along = 0.0;                              ///< Mean along the target's motion in the image.
  Eigen::Vector2d position_slope =
      Eigen::Vector2d::Zero();    ///< Slope over (u, v) − centre, a quarter of the image the unit.
  double position_squares = 0.0;  ///< Σ x² behind the slope: its σ is 1/√ of it.
  double autocorrelation = 0.0;   ///< Correlation with the one before.
  double nis_per_dof = 0.0;
};

/// A parameter of the rig file that the observations may contradict.
struct RigFault {
  std::string name;       ///< "head2.pan_zero_rad", "head1.base_rx_rad", "head2.camera.f", "head2.clock_s".
  double off = 0.0;       ///< By how much it is off if it alone is, in its unit: the true value − the file's.
  double z = 0.0;         ///< Of a right rig normal with mean 0 and σ 1, the sign left out.
  double z_refit = 0.0;   ///< The same by a fit of it where it explains about the most; else z.
  std::size_t head = 0;   ///< Index in the rig's list of heads.
  Eigen::VectorXd moved;  ///< The same of the head's rows in RigUncertainty.
};

/// What the observations would say of a parameter of the rig if it were off.
struct RigPower {
  std::string name;       ///< As of a RigFault.
  std::size_t head = 0;   ///< Index in the rig's list of heads.
  Eigen::VectorXd step;   ///< One unit of it, of the head's rows in RigUncertainty.
  double largest = 0.0;   ///< Errors are smaller.
  double z_per_unit = 0;  ///< By how much an error of one unit would raise z: 0 is never seen.
};

/// Capture times that scatter about those at which images were taken.
struct TimeJitter {
  double sigma_s = 0.0;  ///< Of one time.
  double gain = 0.0;     ///< Of ln p, over innovations that are larger by one factor, whatever the motion.
};

/// Capture times that are whole steps apart, where images were taken between: by the intervals of a head.
struct RoundedTimes {
  double step_s = 0.0;
  double late_m = 0.0;         ///< The target moves so far in half a step; median over the track.
  double late_in_sigma = 0.0;  ///< In σ of its position without this.
};

/// Rows of a head that repeat the one before them exactly, and are kept out.
struct FrozenRows {
  std::size_t head = 0;                            ///< Index in the rig's list of heads.
  bool pan = false, tilt = false, pixels = false;  ///< What repeats.
  std::size_t num = 0;                             ///< Rows that repeat.
  double from_s = 0.0, until_s = 0.0;              ///< Capture times of the first and of the last one.
  bool agrees = false;  ///< The track without them expects every one where it is, as of a target at rest.
};

/// What became of all observations, and how good it is. Positions and velocities are in the rig's world.
struct TrackReport {
  enum class Status { tracked, no_start };
  Status status = Status::no_start;
  double sigma_a_m_s2 = 0.0;
  bool sigma_a_is_found = false;
  double sigma_px = 0.0;                ///< Of observations that state none; 0: of a method that has none.
  bool sigma_px_is_found = false;       ///< From the innovations.
  std::vector<TrackStep> steps;         ///< One per observation, in their order.
  std::vector<PredictedStep> ahead;     ///< One per step, or none.
  std::vector<PredictedStep> smoothed;  ///< In order of time, one per capture time that can be smoothed; else none.
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
  std::vector<double> nees;                      ///< One per step; NaN where there is no truth.
  /// Of a filter that estimates the rig's errors where they are considered: with them only considered, innovations are
  /// coloured by what does not change. One per head.
  std::vector<HeadInnovations> innovations;
  std::optional<TimeJitter> jitter;  ///< Where the innovations ask for it.
  /// Where the times show it and no σ of clocks is given: every covariance has half a step of the target's motion.
  std::optional<RoundedTimes> rounded;
  double inflation = 1.0;           ///< Every covariance was increased by this factor, from the innovations.
  std::vector<RigFault> faults;     ///< The most significant first.
  std::vector<RigPower> power;      ///< Of each parameter that is tested.
  bool fits_without_fault = false;  ///< The first is significant, and with it corrected the observations fit.
  bool errors_are_counted = false;  ///< Those of the rig.
  std::vector<FrozenRows> frozen;   ///< Kept out, in order of heads and times.
};

/// Called with each observation and what became of it. What it throws ends the work.
using TrackWatch = std::function<void(const TargetObservation&, const TrackStep&)>;

/// The result of track(): the path with its covariances (`steps`, and `ahead` and `smoothed` where they were
/// requested), and its verdict.
struct TargetTrack : TrackReport {
  Rig rig;                                      ///< As used: with the σ of the intrinsics histories.
  std::vector<TargetObservation> observations;  ///< As used, one per step; with its lens where the rig has a history.
  TrueTrack truth;
  TrackConfig config;
  std::vector<Assumption> assumed;
  Counts counts;  ///< Of observations.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
