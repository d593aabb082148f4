#pragma once

#include "alidade/observe/checks/turn_patterns.h"
#include "alidade/observe/frame_buffer.h"

namespace alidade {

/// One parameter of a cause, by one linearisation.
struct CauseMember {
  std::string name;  ///< "k1", "of pan"
  std::string unit;
  double value = 0.0,
         sigma = 0.0;  ///< The value that the residuals indicate, and its σ, which includes shared errors.
  CommonVector moves;  ///< Change of the estimated parameters per unit, normalised.
};

/// Score test of something taken as exact: whether freeing it would lower the residuals by more than chance.
struct CauseScore {
  std::string name;   ///< "k1", "encoder scale", "backlash"
  double z = 0.0;     ///< Gain as a normal deviate.
  double gain = 0.0;  ///< Of twice the log-posterior with its typical σ as prior, less its penalty (BIC): the
                      ///< largest explains best.
  std::vector<CauseMember> members;
  Eigen::MatrixXd information;  ///< Of the members, by these residuals and what errors they share.
  CommonVector shift;           ///< Of the estimated parameters if it were free, normalised.
  double from_s = not_seen;     ///< Of a step: from when.
};

/// A rotation of the camera on its mount (a bump), or of the angles' zero, at an instant that is not known: of several
/// the one that explains most.
inline constexpr const char* step_cause = "step of the mounting";

struct CauseConfig {
  ObserveNuisances nuisances;  ///< What was estimated.
  double max_gap_s = 0.25;
  double height = 1.0;                   ///< Of the image, normalised: a rolling shutter's way.
  std::vector<std::string> errors = {};  ///< Causes among the rotation's errors that were estimated.
  std::vector<double> steps_s = {};      ///< When the mounting may have had a step.
};

/// Score (Lagrange multiplier) tests of the reference, all from one linearisation: with point bearings and what was
/// estimated eliminated, information S and score s of a cause give χ² = sᵀ S⁻¹ s and the value −S⁻¹ s. Where residuals
/// share errors in time χ² is divided by their design effect in the cause's own directions, taken after its step:
/// a cause does not hide behind the scatter that it makes. Likewise where those of a track do, up to a factor of four.
/// Tested: k1, k2, k3, p1 and p2, the lens whole; mount, delay, line time of a rolling shutter, lever arm (one parallax
/// for all points, and each point's own along the view), a focal length that drifts, a step of the mounting at some
/// instant, and the patterns of the log's rotation. Rotations that are estimated are eliminated with the points. Rao
/// 1948; docs/maths/rotating-camera.md.
[[nodiscard]] std::vector<CauseScore> cause_scores(const RotationLog& log, const Adjustment& reference,
                                                   const CauseConfig& config);

}  // namespace alidade
