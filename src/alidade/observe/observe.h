#pragma once

#include <string>

#include "alidade/camera/camera.h"
#include "alidade/estimation/verdict.h"
#include "alidade/observe/frame_buffer.h"
#include "alidade/observe/hybrid.h"

namespace alidade {

enum class ObserveMethod { hybrid, window, flow, fang2011, batch };
enum class RotationKnowledge { known, noisy, free };

struct ObserveConfig {
  ObserveMethod method = ObserveMethod::hybrid;
  RotationKnowledge rotation = RotationKnowledge::known;
  std::string profile = "kalman";        ///< Of fang2011: fast, quiet or kalman.
  ObserveNuisances estimate;             ///< Beside fx, fy, cx, cy: k1, mount, delay, lever.
  int width_px = 0, height_px = 0;       ///< 0: what holds the pixels.
  std::optional<Eigen::Vector4d> start;  ///< fx, fy, cx, cy [px]; none: found from the data.
  bool square_pixels = false;            ///< fx = fy.
  bool fixed_centre = false;             ///< cx, cy: the start's, else the picture's middle.
  double sigma_px = 0.0;                 ///< 0: told by the residuals.
  double sigma_angle_rad = 0.0;          ///< Of heads and attitudes, where the rotation is noisy.
  double sigma_rate_rad_per_s = 0.0;     ///< Of rates.
  double sigma_range_m = 0.002;
  std::optional<Eigen::Vector3d> lever_m;  ///< Known, or (with estimate.lever) where to start.
  double max_gap_s = 0.25;                 ///< A longer one in a rate log starts a segment.
  double window_s = 6.0;                   ///< Of `window`.
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

/// One value with σ and the Cramér–Rao bound of this very log.
struct ObservedQuantity {
  std::string name;
  double value = 0.0, sigma = 0.0, bound = 0.0;
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
  /// fx, fy, cx, cy [px], then what else was estimated: k1, mount_x_rad…, delay_s, lever_x_m….
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
  /// What the residuals would gain by estimating it: name and value over σ.
  std::vector<std::pair<std::string, double>> proposals;
};

/// Intrinsics of a rotating camera from what it saw while it turned. Throws Interrupted.
/// docs/maths/rotating-camera.md.
[[nodiscard]] ObserveReport observe(const RotationLog& log, const ObserveConfig& config, const Progress& progress = {});

/// The parts of it that an on-line run needs: the hybrid observer's configuration for a log whose rows are yet to come.
[[nodiscard]] HybridConfig hybrid_config(const RotationLog& layout, const ObserveConfig& config,
                                         const PixelScale& scale);
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

/// Picture's middle and half width: of the size given, else of what holds the pixels.
[[nodiscard]] PixelScale pixel_scale(const RotationLog& log, int& width_px, int& height_px);

/// Would the residuals of `reference` shrink by more than chance if k1, mount or delay were estimated too? Each name
/// with its value over σ.
[[nodiscard]] std::vector<std::pair<std::string, double>> residual_proposals(const FrameBuffer& buffer,
                                                                             const Adjustment& reference,
                                                                             AdjustConfig config,
                                                                             const Progress& progress = {});

/// Where a log without measured rotation may start: a focal length and each row's rotation, from pairs of neighbouring
/// rows, by the focal length that makes them rotations best. None: too few shared points.
struct FreeRotationStart {
  double focal = 1.0;  ///< Normalised, square pixels, centred.
  std::vector<Eigen::Quaterniond> cam_from_start;
};
[[nodiscard]] std::optional<FreeRotationStart> free_rotation_start(const RotationLog& log, const PixelScale& scale);

}  // namespace alidade
