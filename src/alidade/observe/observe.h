#pragma once

#include <string>

#include "alidade/camera/camera.h"
#include "alidade/estimation/verdict.h"
#include "alidade/observe/cause_scores.h"
#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/hybrid.h"
#include "alidade/observe/stated_covariance.h"
#include "alidade/observe/steadiness.h"

namespace alidade {

enum class ObserveMethod { hybrid, window, flow, fang2011, batch };
enum class RotationKnowledge { known, noisy, free };

struct ObserveConfig {
  ObserveMethod method = ObserveMethod::hybrid;
  RotationKnowledge rotation = RotationKnowledge::known;
  std::string profile = "kalman";  ///< Of fang2011: fast, quiet or kalman.
  ObserveNuisances estimate;       ///< Beside fx, fy, cx, cy: k1, k2, k3, tangential, mount, delay, lever, shutter.
  std::vector<std::string> estimate_errors;  ///< And errors of the measured rotation: causes of rotation_errors().
  bool estimate_auto = false;                ///< And what the residuals ask for.
  bool lens_is_given = false;                ///< The pixels were freed of a lens that is given: it is not estimated.
  int width_px = 0, height_px = 0;           ///< 0: what holds the pixels.
  std::optional<Eigen::Vector4d> start;      ///< fx, fy, cx, cy [px]; none: found from the data.
  bool square_pixels = false;                ///< fx = fy.
  bool no_zoom = false;                      ///< The intrinsics are those of one camera: what seems a zoom is none.
  bool fixed_centre = false;                 ///< cx, cy: the start's, else the image's middle.
  double sigma_px = 0.0;                     ///< 0: told by the residuals.
  double sigma_angle_rad = 0.0;              ///< Of heads and attitudes, where the rotation is noisy.
  double sigma_rate_rad_per_s = 0.0;         ///< Of rates.
  double sigma_range_m = 0.002;
  std::optional<Eigen::Vector3d> lever_m;  ///< Known, or (with estimate.lever) where to start.
  double max_gap_s = 0.25;                 ///< A longer one in a rate log starts a segment.
  double window_s = 6.0;                   ///< Of `window`.
  /// What is taken as given, with its σ; 0: exact; none: the log's, or not known.
  std::optional<double> sigma_scale;     ///< Of the measured angles or rates, as a share.
  std::optional<double> sigma_parallax;  ///< Camera centre from the axes along the view, over the points' distance.
  std::optional<double> sigma_k1;        ///< Of the lens that the pixels were freed of.
};

/// Something that happened to the intrinsics or the points.
struct ObserveNote {
  double t_s = 0.0;
  ObserveEvent event = ObserveEvent::none;
  int point = -1;
};

/// How the camera turned, about its own axes. [rad]
struct ObserveMotion {
  Eigen::Vector3d path_rad = Eigen::Vector3d::Zero();  ///< ∫|ω_x|, ∫|ω_y|, ∫|ω_z|.
  double span_rad = 0.0;                               ///< Largest turn away from the start.
};

/// One value with σ and the Cramér–Rao bound of this very log. σ counts errors that residuals share and what is given
/// with a σ; sigma_model: as if every pixel erred by itself.
struct ObservedQuantity {
  std::string name;
  double value = 0.0, sigma = 0.0, bound = 0.0, sigma_model = 0.0;
};

struct ObserveReport {
  enum class Status {
    ok,
    too_few_data,
    unobservable,
    unsteady,  ///< The focal length changes all the time, and the method is for one that does not.
    no_convergence
  };
  Status status = Status::too_few_data;
  PixelScale scale;
  int width_px = 0, height_px = 0;
  std::vector<IntrinsicsEstimate> steps;  ///< One a row.
  std::vector<ObserveNote> events;
  /// fx, fy, cx, cy [px], then what else was estimated: k1, …, mount_x_rad…, delay_s, lever_x_m….
  std::vector<ObservedQuantity> quantities;
  Eigen::MatrixXd covariance;  ///< Of the quantities.
  double sigma_px = 0.0;       ///< Of a pixel coordinate.
  bool sigma_is_told = true;   ///< By the residuals.
  double nis_per_dof = 0.0;
  double gramian_lambda_min = -1.0;  ///< Of fang2011; −1: not asked.
  ObserveMotion motion;
  std::size_t rows_used = 0;
  std::size_t pixels_left_out = 0;
  /// The reference: the rows of the longest time in which the intrinsics did not change, adjusted together.
  /// Its information is the bound's.
  Adjustment reference;
  double reference_from_s = 0.0, reference_until_s = std::numeric_limits<double>::infinity();
  StatedCovariance stated;          ///< Of the reference.
  TurnJitter jitter;                ///< Of its frames.
  std::vector<CauseScore> causes;   ///< What the reference's residuals say of what was taken as exact.
  std::vector<Assumption> assumed;  ///< What was taken as given, and what it would do to the answer.
  /// The answer minus the reference over their σ, the largest of fx, fy, cx, cy, where both are of the same camera.
  double from_reference = 0.0;
  ObserveNuisances estimated;  ///< What was, in the end, beside fx, fy, cx, cy.
  std::vector<std::string> estimated_errors;
  RotationErrors errors;           ///< Of the rotation, as estimated, in units of their ordinary sizes.
  std::vector<Check> told_apart;   ///< What else explains the residuals as well, and what the pixels do not tell.
  std::string misread;             ///< How the rotation seems to be misread, in words; empty: it is not.
  bool sigma_is_distance = false;  ///< The method has no σ: stated is its distance from the reference.
};

/// Intrinsics of a rotating camera from what it saw while it turned. Throws Interrupted.
/// docs/maths/rotating-camera.md.
[[nodiscard]] ObserveReport observe(const RotationLog& log, const ObserveConfig& config, const Progress& progress = {});

/// The same with what is told to be estimated, without a second thought.
[[nodiscard]] ObserveReport observe_as_told(const RotationLog& log, const ObserveConfig& config,
                                            const Progress& progress = {});

/// Is the answer, or that there is none, such that the rotation may be misread? And how: signs, axes, degrees,
/// quaternions the other way round, whichever lets the pixels fit clearly better.
[[nodiscard]] bool may_be_misread(const ObserveReport& report);
[[nodiscard]] std::string misread_rotation(const RotationLog& log, const ObserveConfig& config,
                                           const ObserveReport& report, const Progress& progress = {});

/// The parts of it that an on-line run needs: the hybrid observer's configuration for a log whose rows are yet to come.
[[nodiscard]] HybridConfig hybrid_config(const RotationLog& layout, const ObserveConfig& config,
                                         const PixelScale& scale);
/// fx, fy, cx, cy, then what else the layout has, in its order.
[[nodiscard]] std::vector<std::string> quantity_names(const CommonLayout& layout,
                                                      const std::vector<RotationError>& errors = {});
/// The errors of the log's rotation that are to be estimated, with the σ that is told of their scale. None of those
/// that are told to be exact.
[[nodiscard]] std::vector<RotationError> estimated_errors(const RotationLog& log, const ObserveConfig& config);
[[nodiscard]] bool needs_depth(const RotationLog& log, const ObserveConfig& config);
[[nodiscard]] RotatingCamera start_camera(const ObserveConfig& config, const PixelScale& scale);
/// What the person says of the camera; none if nothing.
[[nodiscard]] std::optional<CommonPrior> said_prior(const ObserveConfig& config, const RotatingCamera& start);

/// What the answer is worth, or why there is none and what to add.
[[nodiscard]] Verdict observe_verdict(const ObserveReport& report, const RotationLog& log, const ObserveConfig& config);

/// The log as a camera without distortion but the same fx, fy, cx, cy would have seen it; pixels that the lens cannot
/// have seen become "not seen".
[[nodiscard]] RotationLog undistorted(const RotationLog& log, const Camera& camera);

/// The camera that was observed, with its covariance: pinhole, or brown where k1 was estimated or `known` has a lens.
[[nodiscard]] Camera observed_camera(const ObserveReport& report, const std::optional<Camera>& known);

/// The word for an event in files: start, burst, slip, zoom, zoom_end, restart, gap; empty for none.
[[nodiscard]] std::string_view event_name(ObserveEvent event);

/// Image's middle and half width: of the size given, else of what holds the pixels.
[[nodiscard]] PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px);

/// What the log and the person give, with the answer's move for an error of its σ or, without one, of what errors
/// ordinarily are or the residuals would still hide, whichever is less. What has a σ is added to `cov` (normalised).
[[nodiscard]] std::vector<Assumption> taken_as_given(const RotationLog& log, const ObserveConfig& config,
                                                     const ObserveReport& report, CommonMatrix& cov);

/// Checks of the verdict that look at the reference's residuals: what they ask for, whether errors are shared, whether
/// the noise is one that trackers have, whether points stand still.
[[nodiscard]] std::vector<Check> residual_checks(const ObserveReport& report);

/// z at which the residuals ask for a cause: noise that a frame's pixels share makes chance larger.
[[nodiscard]] double asked_beyond(const ObserveReport& report);

/// Is the rotation read as it was meant? A mount that turns by half a turn, or a misreading that fits better.
[[nodiscard]] Check rotation_check(const ObserveReport& report);

/// The word of --estimate for a cause: "k1,k2", "mount", "scale", "backlash".
[[nodiscard]] std::string estimate_word_of(const std::string& cause);
/// The causes of a word that are errors of the measured rotation; empty: it is none of them.
[[nodiscard]] std::vector<std::string> rotation_causes_of(const std::string& word);

/// Where a log without measured rotation may start: a focal length and each row's rotation, from pairs of neighbouring
/// rows, by the focal length that makes them rotations best. None: too few shared points.
struct FreeRotationStart {
  double focal = 1.0;  ///< Normalised, square pixels, centred.
  std::vector<Eigen::Quaterniond> cam_from_start;
};
[[nodiscard]] std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale);

}  // namespace alidade
