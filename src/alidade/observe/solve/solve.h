#pragma once

#include <string>

#include "alidade/estimation/progress.h"
#include "alidade/observe/checks/cause_scores.h"
#include "alidade/observe/checks/stated_covariance.h"
#include "alidade/observe/filters/frame_variation.h"
#include "alidade/observe/filters/hybrid.h"
#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/observer.h"
#include "alidade/observe/report.h"
#include "alidade/observe/setup.h"

namespace alidade {

/// The camera was rotated on its mount at one instant: bumped, or removed and put back.
struct MountingStep {
  double t_s = 0.0;              ///< Time of the first row after it.
  Eigen::Vector3d rotation_rad;  ///< About the mount's axes.
  double noise_px = 0.0;         ///< σ of a pixel with the step.
  bool is_counted = false;       ///< Included in σ of the answer through the scatter between blocks of time.
};

/// The report with the intermediate results on which its verdict, bound and tests are based.
struct ObserveSolution : ObserveReport {
  PixelScale scale;
  double gramian_lambda_min = -1.0;  ///< Smallest eigenvalue of fang2011's Gramian; −1: not computed.
  std::size_t rows_used = 0;
  std::size_t pixels_rejected = 0;
  /// The reference: the rows of the longest span with constant intrinsics, adjusted together.
  /// The bound is from its information.
  Adjustment reference;
  StatedCovariance stated;                                   ///< Covariance of the reference.
  RotationJitter jitter;                                     ///< Jitter of the reference's frames.
  std::vector<CauseScore> causes;                            ///< Score tests of the parameters that were assumed exact.
  std::vector<HybridObserver::ConstantSpan> constant_spans;  ///< Spans found by ObserveMethod::hybrid.
  /// The answer minus the reference over their σ, the largest of fx, fy, cx, cy, if both are of the same camera.
  double from_reference = 0.0;
  ObserveNuisances estimated;  ///< What was estimated in the end in addition to fx, fy, cx, cy.
  std::vector<std::string> estimated_errors;
  RotationErrors errors;           ///< Estimated errors of the rotation, in units of their typical sizes.
  std::vector<Check> side_checks;  ///< What explains the residuals equally well, and what the pixels do not determine.
  std::optional<MountingStep> mounting_step;
  std::string misread;             ///< How the rotation seems to be misread, in words; empty: it is not.
  bool sigma_is_distance = false;  ///< The method has no σ: the stated one is the distance from the reference.
};

/// Intrinsics of a rotating camera from its log: estimates what the setup requests, and what the residuals indicate.
/// Throws Interrupted. docs/maths/rotating-camera.md.
[[nodiscard]] ObserveSolution solve_intrinsics(const RotationLog& log, const ObserveSetup& config,
                                               const Progress& progress = {});

/// The same with the requested parameters only.
[[nodiscard]] ObserveSolution solve_as_given(const RotationLog& log, const ObserveSetup& config,
                                             const Progress& progress = {});

/// A misinterpretation of the measured rotation (signs, axes, units, quaternion order).
struct Misread {
  std::string words;          ///< Empty: none was found.
  bool is_sought = false;     ///< All readings were tried.
  bool explains_all = false;  ///< With it, the residuals are no larger than a detector's noise.
};

/// The ways in which such a rotation may be misread; Misread::words is one of them.
[[nodiscard]] std::vector<std::string> misreading_words(RotationSource source);
/// Whether the result suggests that the rotation is misread; and the misreading: signs, axes, degrees, inverse
/// quaternions, whichever fits the pixels clearly better.
[[nodiscard]] bool may_be_misread(const ObserveSolution& report);
[[nodiscard]] Misread misread_rotation(const RotationLog& log, const ObserveSetup& config,
                                       const ObserveSolution& report, const Progress& progress = {});

/// The configuration of the hybrid observer for a log whose rows are yet to come: what an on-line run needs.
[[nodiscard]] HybridConfig hybrid_config(const RotationLog& layout, const ObserveSetup& config,
                                         const PixelScale& scale);
/// fx, fy, cx, cy, then the other parameters of the layout in its order.
[[nodiscard]] std::vector<std::string> quantity_names(const CommonLayout& layout,
                                                      const std::vector<RotationError>& errors = {});
/// The errors of the log's rotation that are to be estimated, with the given σ of their scale. Without those that are
/// given as exact.
[[nodiscard]] std::vector<RotationError> estimated_errors(const RotationLog& log, const ObserveSetup& config);
[[nodiscard]] bool needs_depth(const RotationLog& log, const ObserveSetup& config);
[[nodiscard]] RotatingCamera start_camera(const ObserveSetup& config, const PixelScale& scale);
/// The prior given by the user; none if nothing is given.
[[nodiscard]] std::optional<CommonPrior> said_prior(const ObserveSetup& config, const RotatingCamera& start);

/// The verdict on the estimate, or why there is none and what to add.
[[nodiscard]] Verdict observe_verdict(const ObserveSolution& report, const RotationLog& log,
                                      const ObserveSetup& config);

/// A row in the form of the live view.
[[nodiscard]] ObserveStep step_of(const RotationFrame& frame, const IntrinsicsEstimate& estimate);

/// The observed camera with its covariance: pinhole, or brown if k1 was estimated or `known` has distortion.
[[nodiscard]] Camera observed_camera(const ObserveReport& report, const std::optional<Camera>& known);

/// Centre and half width of the image: of the given size, else of the smallest image that contains the pixels.
[[nodiscard]] PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px);

/// Everything given by the log and the user, with the change of the answer for an error of its σ or, without one, of
/// the smaller of a typical error and the one that residuals allow. Effects of a σ are added to `cov` (normalised).
[[nodiscard]] std::vector<Assumption> taken_as_given(const RotationLog& log, const ObserveSetup& config,
                                                     const ObserveSolution& report, CommonMatrix& cov);

/// Adds to the covariance the shift of the answer by `left`, a cause that the residuals indicate but that could not be
/// estimated; null: none. The answer may be off by as much.
void count_left(const CauseScore* left, const std::vector<RotationError>& errors, ObserveSolution& report);

/// Adds to `cov` (normalised) the effects of assumed errors with a σ above zero, from the scores of their causes.
void add_assumed(const std::vector<Assumption>& assumed, const std::vector<CauseScore>& causes, CommonMatrix& cov);

/// Checks of the verdict on the reference's residuals: indicated causes, shared errors, whether the noise is that of a
/// tracker, whether points are static.
[[nodiscard]] std::vector<Check> residual_checks(const ObserveSolution& report);

/// z above which a cause is indicated: raised if the pixels of a frame share noise.
[[nodiscard]] double asked_beyond(const ObserveSolution& report);

/// Check for a misread rotation: a mount rotated by 180°, or a misreading that fits better.
[[nodiscard]] Check rotation_check(const ObserveSolution& report);

/// Initial guess for a log without measured rotation: a focal length and the rotation of each row, from neighbouring
/// pairs of rows; the focal length is the one for which rotations fit them best. None: too few shared points.
struct FreeRotationStart {
  double focal = 1.0;  ///< Normalised, square pixels, centred.
  std::vector<Eigen::Quaterniond> cam_from_start;
};
[[nodiscard]] std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale);

}  // namespace alidade
