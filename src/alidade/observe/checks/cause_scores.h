#pragma once

#include "alidade/observe/checks/turn_patterns.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// One parameter of a cause, from one linearisation.
struct CauseMember {
  std::string name;  ///< "k1", "of pan"
  std::string unit;
  double value = 0.0,
         sigma = 0.0;  ///< The value that the residuals indicate, and its σ, which includes shared errors.
  CommonVector moves;  ///< Change of the estimated parameters per unit, normalised.
};

/// Score test of a parameter assumed exact: whether estimating it would lower the residuals by more than chance.
struct CauseScore {
  std::string name;   ///< "k1", "encoder scale", "backlash"
  double z = 0.0;     ///< Gain as a standard normal deviate.
  double gain = 0.0;  ///< Gain in twice the log-posterior with the typical σ as prior, less its penalty (BIC): the
                      ///< largest explains best.
  std::vector<CauseMember> members;
  Eigen::MatrixXd information;  ///< Information on the members, with the errors that residuals share.
  CommonVector shift;           ///< Shift of the estimated parameters with the cause estimated too.
  double from_s = not_seen;     ///< For a step: its instant [s].
};

/// A rotation of the camera on its mount (a bump), or of the zero of the angles, at an unknown instant: of several
/// candidates, the one that explains most.
inline constexpr const char* step_cause = "step of the mounting";

struct CauseConfig {
  ObserveNuisances nuisances;  ///< The estimated parameters.
  double max_gap_s = 0.25;
  double height = 1.0;                   ///< Image height, normalised: path of a rolling shutter.
  std::vector<std::string> errors = {};  ///< Causes that were estimated as errors of the rotation.
  std::vector<double> steps_s = {};      ///< Candidate instants of a step of the mounting [s].
};

/// Score (Lagrange multiplier) tests of the reference, all from one linearisation: with point bearings and
/// estimated parameters eliminated, information S and score s of a cause give χ² = sᵀ S⁻¹ s and the value
/// −S⁻¹ s. Where residuals share errors in time, χ² is divided by their design effect in the cause's own
/// directions, evaluated after its step: thus a cause is not hidden by the scatter it creates. The same for
/// errors shared along tracks, up to a factor of 4. Tested: k1, k2, k3, p1 and p2, all of them; mount, delay,
/// line time of a rolling shutter, lever arm (one parallax for all points, and one per point along the view),
/// a drifting focal length, a step of the mounting at some instant, and the error patterns of the log's
/// rotation. Estimated rotations are eliminated with the points. Rao 1948; docs/maths/rotating-camera.md.
[[nodiscard]] std::vector<CauseScore> cause_scores(const RotationLog& log, const Adjustment& reference,
                                                   const CauseConfig& config);

}  // namespace alidade
