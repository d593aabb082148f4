#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/verdict.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/pantilt/rig.h"
#include "alidade/public.h"
#include "alidade/rig/config.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One view of a head after the solve.
struct HeadViewFit {
  std::string name;  ///< As in the table: "view 3", or the name of its photo.
  bool used = false;
  std::string reason;      ///< Why it was not used; empty otherwise.
  std::string misreading;  ///< Probable mistake in its row: "fits board 3"; empty: none of those tried fits.
  double chi2 = 0.0;       ///< χ² of corners and reading for the estimated rig; computed for rejected views too.
  double rms_px = 0.0;     ///< Per point.
  Eigen::Vector2d reading_correction_rad = Eigen::Vector2d::Zero();  ///< Estimated reading minus actual reading.
  std::vector<Eigen::Vector2d> residual_px;                          ///< Prediction − observation, one per corner.
  double cluster_z2 = 0.0;  ///< Squared influence on the rig over that expected from noise; 0: not used.
};

/// An estimated pose of the board in the world.
struct RigBoard {
  int board = 0;
  Rigid3 world_from_board;
};

/// Threshold [σ] above which a cause is indicated: with forty causes tested, one clean rig in a thousand exceeds it.
inline constexpr double rig_cause_limit = 4.2;
/// Threshold [σ] for freeing a parameter: lower, as a needless one only costs σ; one clean rig in seven exceeds it.
inline constexpr double rig_free_limit = 2.6, rig_free_joint_limit = 2.6;

/// An axis that was rotated by less than this counts as not rotated. [rad]
inline constexpr double min_span_rad = 0.07;
/// Range of each axis (20°) over which σ of the rig is assessed. [rad]
inline constexpr double good_span_rad = 0.35;

/// What the views of one head cover.
struct HeadCover {
  int id = 0;
  int num_views = 0, num_boards = 0;
  int num_used = 0;  ///< Views used; the others were rejected.
  Eigen::Vector2d lowest_rad = Eigen::Vector2d::Zero(), highest_rad = Eigen::Vector2d::Zero();  ///< Pan, tilt.
  int num_shared_boards = 0;  ///< Number of its boards that another head sees too.
};

/// What to do about a lens that does not match its camera file.
inline constexpr const char* lens_remedy = "calibrate that lens again";
/// Name of a cause: boards were moved between the views of one head and those of another.
inline constexpr const char* moved_boards_name = "board positions";
/// Names of causes: the print is longer along its columns than its rows (relative); its points are not coplanar [m].
inline constexpr const char *board_stretch_name = "board stretch", *board_bend_name = "board bend";
/// Name of a cause: the focal length of a head's camera drifts over the views in the order taken.
inline constexpr const char* focal_drift_name = "focal length drift";

/// A cause that the residuals indicate, by a score test of one additional parameter: its size and significance.
struct RigCause {
  std::string name;  ///< "head1.pan_scale", "head2.tilt once a turn", "head1.pan zero drift", moved_boards_name
  double size = 0.0;
  std::string unit;
  double sigmas = 0.0;

  /// A drift of a head's base, of a zero or of a focal length over the views in the order taken.
  [[nodiscard]] bool is_drift() const { return name.ends_with(" drift"); }
  /// For comparison: a cause of one head outranks a cause of all heads or of boards that explains only slightly more.
  [[nodiscard]] double rank() const { return sigmas * (name.starts_with("all ") ? 0.8 : is_of_boards() ? 0.7 : 1.0); }
  /// Boards were moved between the views of one head and those of another.
  [[nodiscard]] bool is_of_boards() const { return name == moved_boards_name; }
  /// An error of the board itself, whichever head sees it.
  [[nodiscard]] bool is_of_print() const { return name == board_stretch_name || name == board_bend_name; }
  /// Causes that are only reported: the model of the rig has no parameter for them.
  [[nodiscard]] bool has_no_parameter() const {
    return is_drift() || is_distortion() || is_of_boards() || is_of_print() || name.ends_with("camera.fy");
  }
  /// Lens distortion beyond that of the camera file.
  [[nodiscard]] bool is_distortion() const { return name.ends_with("camera.k1"); }
  [[nodiscard]] bool is_of_lens() const { return name.find("camera.") != std::string::npos || name == "all centre"; }
};

/// A parameter that was estimated because the residuals indicated it.
struct RigFreed {
  std::string name;  ///< "head1.pan_scale", "head1.camera.f", "head2.pan_cos_rad"
  double value = 0.0, sigma = 0.0;
  double was = 0.0;          ///< As given.
  double was_sigma = 0.0;    ///< σ with which it was given; 0: treated as exact.
  double pair_sigmas = 0.0;  ///< Significance of both amplitudes of a period together [σ]; 0: not an amplitude.

  /// Deviation from the given value in units of their combined σ; for an amplitude at least that of its pair.
  [[nodiscard]] double sigmas() const;
};

struct RigReport {
  enum class Status {
    converged,
    too_few,     ///< Too few usable views.
    degenerate,  ///< A combination of parameters is unobservable; see `unknown`.
    not_linked,  ///< A head shares no board with the others.
    degrees,     ///< The readings are in degrees.
    swapped,     ///< The cameras belong to each other's heads.
    mirrored,    ///< A head sees its boards from behind: its images are mirrored.
    misread,     ///< The table does not match how the views were taken; see `misreading`.
    no_convergence
  };
  Status status = Status::too_few;
  Rig rig;  ///< World frame: the first head's camera at zero readings. Its covariance is clustered by view
            ///< and includes the σ of what is given.
  Eigen::MatrixXd cov_model;                  ///< Like rig.cov, for independent errors and everything given exact.
  ClusterCovariance clusters;                 ///< One cluster per view; of the estimated parameters.
  std::vector<Assumption> assumed;            ///< Lenses, the squares, the encoders' scales.
  std::optional<RigCause> lens_of_views;      ///< What the views indicate of a lens, regardless of the heads.
  std::vector<RigCause> causes;               ///< Tested one at a time, the most significant first.
  std::vector<RigFreed> freed;                ///< Parameters freed because the residuals indicated them.
  std::string alike;                          ///< Two causes that explain the residuals equally well; empty: none.
  std::vector<Eigen::Vector2d> backlash_rad;  ///< Pan, tilt of each head; 0 where it was not estimated.
  std::vector<Eigen::Vector2d> sigma_backlash_rad;  ///< σ of backlash_rad.
  double deviance = 0.0;  ///< −2 ln likelihood, up to a constant that depends on the views: for comparing solves.
  std::vector<RigBoard> boards;
  std::vector<HeadViewFit> views;    ///< One per view.
  std::vector<HeadCover> covers;     ///< One per head.
  int mirrored_head = 0;             ///< Id of the mirrored head, if there is one.
  std::string misreading;            ///< The correction of the table that makes the views agree; empty: none needed.
  std::string misreading_remedy;     ///< What to provide instead.
  std::vector<std::string> unknown;  ///< Parameters in the unobservable combination.
  double sigma_px = 0.0, sigma_encoder_rad = 0.0;
  bool sigma_px_is_estimated = false, sigma_encoder_is_estimated = false;  ///< From the residuals.
  double chi2 = 0.0;  ///< χ² of whitened corners and reading corrections.
  int dof = 0;
  double rms_px = 0.0;  ///< Per point, over the used views.
  /// σ of the pose of another head's camera in the first camera's frame (one head: of its camera after a rotation,
  /// relative to before), the worst over the angles covered: the quality of the calibration.
  double sigma_relative_rad = 0.0, sigma_relative_m = 0.0;
  double sigma_span_rad = 0.0, sigma_span_m = 0.0;  ///< The same over good_span_rad where less is covered.
  int views_used = 0, views_dropped = 0, iterations = 0;

  [[nodiscard]] double chi2_per_dof() const { return dof > 0 ? chi2 / dof : 0.0; }
};

ALIDADE_PUBLIC_END
}  // namespace alidade
