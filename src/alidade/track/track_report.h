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

/// State of the target at a future or past time.
struct PredictedStep {
  double t_s = 0.0;
  bool has_belief = false;
  Belief<6> belief;
};

/// Statistics of one head's whitened innovations: with a correct model they are white, with zero mean wherever the
/// target is and however it moves. Innovations rejected by the gate are included, scaled down to the gate.
struct HeadInnovations {
  std::size_t num = 0;
  Eigen::Vector2d mean = Eigen::Vector2d::Zero();  ///< In u and v.
  double along = 0.0;                              ///< Mean along the target's motion in the image.
  Eigen::Vector2d position_slope =
      Eigen::Vector2d::Zero();    ///< Slope against (u, v) − image centre, in quarters of the image size.
  double position_squares = 0.0;  ///< Σ x² of the slope; the σ of the slope is 1/√Σ x².
  double autocorrelation = 0.0;   ///< Correlation of consecutive innovations.
  double nis_per_dof = 0.0;
};

/// A parameter of the rig file that the observations may contradict.
struct RigFault {
  std::string name;       ///< "head2.pan_zero_rad", "head1.base_rx_rad", "head2.camera.f", "head2.clock_s".
  double off = 0.0;       ///< Estimated error if it is the only one, in its own unit: true value − value in the file.
  double z = 0.0;         ///< |z| of the score test; z is standard normal for a correct rig.
  double z_refit = 0.0;   ///< The same with the parameter re-estimated, if it is among those that explain most; else z.
  std::size_t head = 0;   ///< Index in the rig's list of heads.
  Eigen::VectorXd moved;  ///< The error `off` as a change of the head's rows in RigUncertainty.
};

/// Power of the test of one rig parameter.
struct RigPower {
  std::string name;       ///< Named as in RigFault.
  std::size_t head = 0;   ///< Index in the rig's list of heads.
  Eigen::VectorXd step;   ///< Change of the head's rows in RigUncertainty for one unit of the parameter.
  double largest = 0.0;   ///< Assumed upper bound of its error.
  double z_per_unit = 0;  ///< Increase of z per unit of error; 0: unobservable.
};

/// Random errors of the capture times.
struct TimeJitter {
  double sigma_s = 0.0;  ///< σ of one capture time.
  double gain = 0.0;     ///< Gain in log-likelihood over innovations inflated by one factor, regardless of motion.
};

/// Capture times rounded to a step, although the intervals of a head show that its images were taken between steps.
struct RoundedTimes {
  double step_s = 0.0;
  double late_m = 0.0;         ///< Motion of the target in half a step; median over the track.
  double late_in_sigma = 0.0;  ///< The same in units of σ of the position, before σ is increased for it.
};

/// Rows of a head that repeat the previous row exactly, and are excluded.
struct FrozenRows {
  std::size_t head = 0;                            ///< Index in the rig's list of heads.
  bool pan = false, tilt = false, pixels = false;  ///< Which values repeat.
  std::size_t num = 0;                             ///< Number of repeating rows.
  double from_s = 0.0, until_s = 0.0;              ///< Capture times of the first and the last of them.
  bool agrees = false;  ///< The track without them predicts each of them, as for a target at rest.
};

/// The track, the use of each observation, and quality figures. Positions and velocities are in the rig's world frame.
struct TrackReport {
  enum class Status { tracked, no_start };
  Status status = Status::no_start;
  double sigma_a_m_s2 = 0.0;
  bool sigma_a_is_found = false;
  double sigma_px = 0.0;                ///< For observations without their own σ; 0: the method uses none.
  bool sigma_px_is_found = false;       ///< Estimated from the innovations.
  std::vector<TrackStep> steps;         ///< One per observation, in the same order.
  std::vector<PredictedStep> ahead;     ///< One per step, or none.
  std::vector<PredictedStep> smoothed;  ///< In chronological order, one per capture time that can be smoothed; or none.
  std::size_t num_used = 0, num_starts = 0, num_restarts = 0;
  double log_likelihood = 0.0;  ///< Log-likelihood of all innovations, up to a constant.
  /// Compared with the true path after the warm-up; NaN without truth.
  double rms_m = std::numeric_limits<double>::quiet_NaN();
  double mean_error_m = std::numeric_limits<double>::quiet_NaN();
  double nees_per_dof = std::numeric_limits<double>::quiet_NaN();
  double smoothed_rms_m = std::numeric_limits<double>::quiet_NaN();
  double pcrlb_m = std::numeric_limits<double>::quiet_NaN();
  double nis_per_dof =
      std::numeric_limits<double>::quiet_NaN();  ///< Of used observations; gated ones clipped at the gate.
  std::vector<double> nees;                      ///< One per step; NaN where there is no truth.
  /// One per head. If errors of the rig are considered, they come from a filter that estimates these: if they are only
  /// considered, the constant errors make the innovations coloured.
  std::vector<HeadInnovations> innovations;
  std::optional<TimeJitter> jitter;  ///< Where the innovations indicate it.
  /// Where the times show it and no σ of clocks is given: all covariances include the target's motion in half a step.
  std::optional<RoundedTimes> rounded;
  double inflation = 1.0;           ///< Factor by which every covariance was increased, from the innovations.
  std::vector<RigFault> faults;     ///< The most significant first.
  std::vector<RigPower> power;      ///< One per tested parameter.
  bool fits_without_fault = false;  ///< The first fault is significant, and with it corrected the observations fit.
  bool errors_are_counted = false;  ///< The errors of the rig are considered in the covariances.
  std::vector<FrozenRows> frozen;   ///< Excluded rows, by head and time.
};

/// Called with each observation and its result. Exceptions from it end the run.
using TrackWatch = std::function<void(const TargetObservation&, const TrackStep&)>;

/// The result of track(): the path with its covariances (`steps`, and `ahead` and `smoothed` if requested),
/// and its verdict.
struct TargetTrack : TrackReport {
  Rig rig;                                      ///< As used: with σ of the intrinsics from the histories.
  std::vector<TargetObservation> observations;  ///< As used, one per step; with its own lens if the rig has a history.
  TrueTrack truth;
  TrackConfig config;
  std::vector<Assumption> assumed;
  Counts counts;  ///< Number of observations.
  Verdict verdict;
};

ALIDADE_PUBLIC_END
}  // namespace alidade
