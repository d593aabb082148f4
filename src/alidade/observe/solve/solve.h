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

/// The camera was rotated on its mount at one instant: bumped, or taken off and put back.
struct MountingStep {
  double t_s = 0.0;              ///< From this row on.
  Eigen::Vector3d rotation_rad;  ///< About the mount's axes.
  double noise_px = 0.0;         ///< Of a pixel, with it.
  bool is_counted = false;       ///< In the answer's σ, by what blocks of time scatter.
};

/// The report with the intermediate results that its verdict, bound and tests are based on.
struct ObserveSolution : ObserveReport {
  PixelScale scale;
  double gramian_lambda_min = -1.0;  ///< Of fang2011; −1: not asked.
  std::size_t rows_used = 0;
  std::size_t pixels_rejected = 0;
  /// The reference: the rows of the longest time in which the intrinsics did not change, adjusted together.
  /// Its information is the bound's.
  Adjustment reference;
  StatedCovariance stated;                                   ///< Of the reference.
  RotationJitter jitter;                                     ///< Of its frames.
  std::vector<CauseScore> causes;                            ///< Score tests of what was taken as exact.
  std::vector<HybridObserver::ConstantSpan> constant_spans;  ///< Of ObserveMethod::hybrid.
  /// The answer minus the reference over their σ, the largest of fx, fy, cx, cy, where both are of the same camera.
  double from_reference = 0.0;
  ObserveNuisances estimated;  ///< What was, in the end, beside fx, fy, cx, cy.
  std::vector<std::string> estimated_errors;
  RotationErrors errors;           ///< Of the rotation, as estimated, in units of their ordinary sizes.
  std::vector<Check> side_checks;  ///< What else explains the residuals as well, and what the pixels do not determine.
  std::optional<MountingStep> mounting_step;
  std::string misread;             ///< How the rotation seems to be misread, in words; empty: it is not.
  bool sigma_is_distance = false;  ///< The method has no σ: stated is its distance from the reference.
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
  std::string words;          ///< Empty: it was not.
  bool is_sought = false;     ///< All readings were tried.
  bool explains_all = false;  ///< With it, the residuals are no larger than a detector's noise.
};

/// The ways in which such a rotation is misread; the words of a Misread are among them.
[[nodiscard]] std::vector<std::string> misreading_words(RotationSource source);
/// Whether the result suggests that the rotation is misread; and the misreading: signs, axes, degrees, inverse
/// quaternions, whichever fits the pixels clearly better.
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
/// The prior given by the user; none if nothing is given.
[[nodiscard]] std::optional<CommonPrior> said_prior(const ObserveSetup& config, const RotatingCamera& start);

/// The verdict on the estimate, or why there is none and what to add.
[[nodiscard]] Verdict observe_verdict(const ObserveSolution& report, const RotationLog& log,
                                      const ObserveSetup& config);

/// A row as the live view shows it.
[[nodiscard]] ObserveStep step_of(const RotationFrame& frame, const IntrinsicsEstimate& estimate);

/// The camera that was observed, with its covariance: pinhole, or brown where k1 was estimated or `known` has a lens.
[[nodiscard]] Camera observed_camera(const ObserveReport& report, const std::optional<Camera>& known);

/// Image's centre and half width: of the given size, else of the smallest that contains the pixels.
[[nodiscard]] PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px);

/// What the log and the person give, with the answer's move for an error of its σ or, without one, of what errors
/// ordinarily are or the residuals would still hide, whichever is less. What has a σ is added to `cov` (normalised).
[[nodiscard]] std::vector<Assumption> taken_as_given(const RotationLog& log, const ObserveSetup& config,
                                                     const ObserveSolution& report, CommonMatrix& cov);

/// What the residuals ask for though it could not be freed, null: nothing, is in the answer, which may be off by as
/// much: adds that to its covariance.
void count_left(const CauseScore* left, const std::vector<RotationError>& errors, ObserveSolution& report);

/// Adds to `cov` (normalised) what the errors do that are assumed with a σ above zero, by these scores of their causes.
void add_assumed(const std::vector<Assumption>& assumed, const std::vector<CauseScore>& causes, CommonMatrix& cov);

/// Checks of the verdict on the reference's residuals: indicated causes, shared errors, whether the noise is that of a
/// tracker, whether points are static.
[[nodiscard]] std::vector<Check> residual_checks(const ObserveSolution& report);

/// z beyond which a cause is indicated: raised where the pixels of a frame share noise.
[[nodiscard]] double asked_beyond(const ObserveSolution& report);

/// Check for a misread rotation: a mount rotated by 180°, or a misreading that fits better.
[[nodiscard]] Check rotation_check(const ObserveSolution& report);

/// Initial guess for a log without measured rotation: a focal length and each row's rotation, from neighbouring pairs
/// of rows, by the focal length that makes them rotations best. None: too few shared points.
struct FreeRotationStart {
  double focal = 1.0;  ///< Normalised, square pixels, centred.
  std::vector<Eigen::Quaterniond> cam_from_start;
};
[[nodiscard]] std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale);

}  // namespace alidade
