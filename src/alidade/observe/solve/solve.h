#pragma once

#include <string>

#include "alidade/estimation/progress.h"
#include "alidade/observe/checks/cause_scores.h"
#include "alidade/observe/checks/stated_covariance.h"
#include "alidade/observe/filters/hybrid.h"
#include "alidade/observe/filters/steadiness.h"
#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/observer.h"
#include "alidade/observe/report.h"
#include "alidade/observe/setup.h"

namespace alidade {

/// A report while it is made: with what its sentences, its bound and its tests rest on.
struct ObserveSolution : ObserveReport {
  PixelScale scale;
  double gramian_lambda_min = -1.0;  ///< Of fang2011; −1: not asked.
  std::size_t rows_used = 0;
  std::size_t pixels_rejected = 0;
  /// The reference: the rows of the longest time in which the intrinsics did not change, adjusted together.
  /// Its information is the bound's.
  Adjustment reference;
  StatedCovariance stated;         ///< Of the reference.
  TurnJitter jitter;               ///< Of its frames.
  std::vector<CauseScore> causes;  ///< What the reference's residuals say of what was taken as exact.
  /// The answer minus the reference over their σ, the largest of fx, fy, cx, cy, where both are of the same camera.
  double from_reference = 0.0;
  ObserveNuisances estimated;  ///< What was, in the end, beside fx, fy, cx, cy.
  std::vector<std::string> estimated_errors;
  RotationErrors errors;           ///< Of the rotation, as estimated, in units of their ordinary sizes.
  std::vector<Check> side_checks;  ///< What else explains the residuals as well, and what the pixels do not determine.
  std::string misread;             ///< How the rotation seems to be misread, in words; empty: it is not.
  bool sigma_is_distance = false;  ///< The method has no σ: stated is its distance from the reference.
};

/// Intrinsics of a rotating camera from what it saw while it rotated: what the setup asks for, and what the residuals
/// do. Throws Interrupted. docs/maths/rotating-camera.md.
[[nodiscard]] ObserveSolution solve_intrinsics(const RotationLog& log, const ObserveSetup& config,
                                               const Progress& progress = {});

/// The same with what is given to be estimated, without a second thought.
[[nodiscard]] ObserveSolution solve_as_given(const RotationLog& log, const ObserveSetup& config,
                                             const Progress& progress = {});

/// How a rotation was read otherwise than it was meant.
struct Misread {
  std::string words;          ///< Empty: it was not.
  bool is_sought = false;     ///< All readings were tried.
  bool explains_all = false;  ///< Read so, the pixels fit as a finder's do.
};

/// Is the answer, or that there is none, such that the rotation may be misread? And how: signs, axes, degrees,
/// quaternions the other way round, whichever lets the pixels fit clearly better.
[[nodiscard]] bool may_be_misread(const ObserveSolution& report);
[[nodiscard]] Misread misread_rotation(const RotationLog& log, const ObserveSetup& config,
                                       const ObserveSolution& report, const Progress& progress = {});

/// The parts of it that an on-line run needs: the hybrid observer's configuration for a log whose rows are yet to come.
[[nodiscard]] HybridConfig hybrid_config(const RotationLog& layout, const ObserveSetup& config,
                                         const PixelScale& scale);
/// fx, fy, cx, cy, then what else the layout has, in its order.
[[nodiscard]] std::vector<std::string> quantity_names(const CommonLayout& layout,
                                                      const std::vector<RotationError>& errors = {});
/// The errors of the log's rotation that are to be estimated, with the σ that is given of their scale. None of those
/// that are given as exact.
[[nodiscard]] std::vector<RotationError> estimated_errors(const RotationLog& log, const ObserveSetup& config);
[[nodiscard]] bool needs_depth(const RotationLog& log, const ObserveSetup& config);
[[nodiscard]] RotatingCamera start_camera(const ObserveSetup& config, const PixelScale& scale);
/// What the person says of the camera; none if nothing.
[[nodiscard]] std::optional<CommonPrior> said_prior(const ObserveSetup& config, const RotatingCamera& start);

/// What the answer is worth, or why there is none and what to add.
[[nodiscard]] Verdict observe_verdict(const ObserveSolution& report, const RotationLog& log,
                                      const ObserveSetup& config);

/// What a row shows whoever watches.
[[nodiscard]] ObserveStep step_of(const RotationFrame& frame, const IntrinsicsEstimate& estimate);

/// The camera that was observed, with its covariance: pinhole, or brown where k1 was estimated or `known` has a lens.
[[nodiscard]] Camera observed_camera(const ObserveReport& report, const std::optional<Camera>& known);

/// Image's centre and half width: of the size given, else of what holds the pixels.
[[nodiscard]] PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px);

/// What the log and the person give, with the answer's move for an error of its σ or, without one, of what errors
/// ordinarily are or the residuals would still hide, whichever is less. What has a σ is added to `cov` (normalised).
[[nodiscard]] std::vector<Assumption> taken_as_given(const RotationLog& log, const ObserveSetup& config,
                                                     const ObserveSolution& report, CommonMatrix& cov);

/// Checks of the verdict that look at the reference's residuals: what they ask for, whether errors are shared, whether
/// the noise is one that trackers have, whether points stand still.
[[nodiscard]] std::vector<Check> residual_checks(const ObserveSolution& report);

/// z at which the residuals ask for a cause: noise that a frame's pixels share makes chance larger.
[[nodiscard]] double asked_beyond(const ObserveSolution& report);

/// Is the rotation read as it was meant? A mount rotated by half a turn, or a misreading that fits better.
[[nodiscard]] Check rotation_check(const ObserveSolution& report);

/// Where a log without measured rotation may start: a focal length and each row's rotation, from pairs of neighbouring
/// rows, by the focal length that makes them rotations best. None: too few shared points.
struct FreeRotationStart {
  double focal = 1.0;  ///< Normalised, square pixels, centred.
  std::vector<Eigen::Quaterniond> cam_from_start;
};
[[nodiscard]] std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale);

}  // namespace alidade
