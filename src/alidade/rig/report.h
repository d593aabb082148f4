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

/// One view after the solve.
struct HeadViewFit {
  std::string name;  ///< As its table has it: "view 3", or its photo.
  bool used = false;
  std::string reason;      ///< Why it was not used; empty otherwise.
  std::string misreading;  ///< Of its row, with which it would fit: "fits board 3"; empty: none that was tried.
  double chi2 = 0.0;       ///< Corners and reading, against the rig as solved; also of a view that was rejected.
  double rms_px = 0.0;     ///< Per point.
  Eigen::Vector2d reading_correction_rad = Eigen::Vector2d::Zero();  ///< Estimated reading minus actual reading.
  std::vector<Eigen::Vector2d> residual_px;                          ///< Prediction − observation, one per corner.
  double cluster_z2 = 0.0;  ///< Its squared influence on the rig over that of its noise alone; 0: unused.
};

/// A pose of the board, in the world.
struct RigBoard {
  int board = 0;
  Rigid3 world_from_board;
};

/// Beyond so many σ a cause is indicated: of forty that are tested, one clean rig in a thousand is above.
inline constexpr double rig_cause_limit = 4.2;
/// A parameter freed without need only costs σ: so a lower threshold, exceeded by one clean rig in seven.
inline constexpr double rig_free_limit = 2.6, rig_free_joint_limit = 2.6;

/// A rotation about an axis below this counts as none. [rad]
inline constexpr double min_span_rad = 0.07;
/// Range of each axis, 20°, over which σ of the rig is assessed. [rad]
inline constexpr double good_span_rad = 0.35;

/// What the views of one head cover.
struct HeadCover {
  int id = 0;
  int num_views = 0, num_boards = 0;
  int num_used = 0;  ///< Of these views; the others were rejected.
  Eigen::Vector2d lowest_rad = Eigen::Vector2d::Zero(), highest_rad = Eigen::Vector2d::Zero();  ///< Pan, tilt.
  int num_shared_boards = 0;  ///< Seen by another head, too.
};

/// What to do about a lens that is not its file's.
inline constexpr const char* lens_remedy = "calibrate that lens again";
/// Name of a cause: boards were moved between the views of one head and those of another.
inline constexpr const char* moved_boards_name = "board positions";
/// Its print is wider along its columns than along its rows, by a share; its points do not lie in a plane [m].
inline constexpr const char *board_stretch_name = "board stretch", *board_bend_name = "board bend";
/// Of a head, over the views as they were taken.
inline constexpr const char* focal_drift_name = "focal length drift";

/// A parameter that the residuals indicate to be free: by how many σ, and its value (a score test).
struct RigCause {
  std::string name;  ///< "head1.pan_scale", "head2.tilt once a turn", "head1.pan zero drift", moved_boards_name
  double size = 0.0;
  std::string unit;
  double sigmas = 0.0;

  /// Of a head's base, or of a zero, over the views as they were taken.
  [[nodiscard]] bool is_drift() const { return name.ends_with(" drift"); }
  /// To compare by: what names one thing says more than what names many, where it explains nearly as much.
  [[nodiscard]] double rank() const { return sigmas * (name.starts_with("all ") ? 0.8 : is_of_boards() ? 0.7 : 1.0); }
  /// Of boards, between the views of one head and those of another.
  [[nodiscard]] bool is_of_boards() const { return name == moved_boards_name; }
  /// Of the board itself, whoever sees it.
  [[nodiscard]] bool is_of_print() const { return name == board_stretch_name || name == board_bend_name; }
  /// Named, as a rig has no such parameter.
  [[nodiscard]] bool has_no_parameter() const {
    return is_drift() || is_distortion() || is_of_boards() || is_of_print() || name.ends_with("camera.fy");
  }
  /// Of a lens, beyond what its file says.
  [[nodiscard]] bool is_distortion() const { return name.ends_with("camera.k1"); }
  [[nodiscard]] bool is_of_lens() const { return name.find("camera.") != std::string::npos || name == "all centre"; }
};

/// Something that was estimated because the residuals indicated it.
struct RigFreed {
  std::string name;  ///< "head1.pan_scale", "head1.camera.f", "head2.pan_cos_rad"
  double value = 0.0, sigma = 0.0;
  double was = 0.0;          ///< As given.
  double was_sigma = 0.0;    ///< With which it was given; 0: as if exact.
  double pair_sigmas = 0.0;  ///< Of both amplitudes of a period together, as σ of a normal; 0: it is no amplitude.

  /// How far it is from what was given, in σ of both; an amplitude: its own or its pair's, whichever is more.
  [[nodiscard]] double sigmas() const;
};

struct RigReport {
  enum class Status {
    converged,
    too_few,     ///< Usable views.
    degenerate,  ///< A combination of parameters is unobservable; `unknown` names it.
    not_linked,  ///< A head shares no board with the others.
    degrees,     ///< The readings are degrees.
    swapped,     ///< The cameras belong to the other heads.
    mirrored,    ///< A head sees its boards from behind: its images are mirrored.
    misread,     ///< The table is not as it was taken; `misreading` says how.
    no_convergence
  };
  Status status = Status::too_few;
  Rig rig;  ///< World: the first head's camera at readings of zero. Covariance: views are clusters, and what is given
            ///< with a σ is included.
  Eigen::MatrixXd cov_model;                        ///< As rig.cov, with independent errors and everything given exact.
  ClusterCovariance clusters;                       ///< Views; of the parameters that are solved for.
  std::vector<Assumption> assumed;                  ///< Lenses, the square, the encoders' scales.
  std::optional<RigCause> lens_of_views;            ///< What the views, each by itself, say of a lens.
  std::vector<RigCause> causes;                     ///< Tested one by one, the most significant first.
  std::vector<RigFreed> freed;                      ///< By need.
  std::string alike;                                ///< Two causes that explain the residuals alike; empty: none.
  std::vector<Eigen::Vector2d> backlash_rad;        ///< Pan, tilt of each head, where it was estimated; 0 else.
  std::vector<Eigen::Vector2d> sigma_backlash_rad;  ///< Of it.
  double deviance = 0.0;  ///< −2 ln of the likelihood, less a constant of the views: what two solves are compared by.
  std::vector<RigBoard> boards;
  std::vector<HeadViewFit> views;    ///< One per view.
  std::vector<HeadCover> covers;     ///< One per head.
  int mirrored_head = 0;             ///< Its id, where one is.
  std::string misreading;            ///< The change of the table that makes the views agree; empty: none is needed.
  std::string misreading_remedy;     ///< What to give instead.
  std::vector<std::string> unknown;  ///< Parameters of the combination that is unobservable.
  double sigma_px = 0.0, sigma_encoder_rad = 0.0;
  bool sigma_px_is_estimated = false, sigma_encoder_is_estimated = false;  ///< From the residuals.
  double chi2 = 0.0;  ///< Whitened corners and reading corrections.
  int dof = 0;
  double rms_px = 0.0;  ///< Per point, of the used views.
  /// σ of where another head's camera (else the camera after a rotation, against where it started) stands, over the
  /// angles covered: what the calibration is for.
  double sigma_relative_rad = 0.0, sigma_relative_m = 0.0;
  double sigma_span_rad = 0.0, sigma_span_m = 0.0;  ///< The same over good_span_rad where less is covered.
  int views_used = 0, views_dropped = 0, iterations = 0;

  [[nodiscard]] double chi2_per_dof() const { return dof > 0 ? chi2 / dof : 0.0; }
};

ALIDADE_PUBLIC_END
}  // namespace alidade
