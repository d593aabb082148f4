#pragma once

#include <map>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/pantilt/rig.h"

namespace alidade {

struct RigConfig {
  std::optional<double> sigma_px;           ///< Of a corner's coordinate; none: told by the residuals.
  std::optional<double> sigma_encoder_rad;  ///< Of a reading; none: told by the residuals.
  bool estimate_scales = false;             ///< Radians of the axes for each radian read.
  bool estimate_once = false;               ///< An error of one period a turn of each axis.
  bool estimate_backlash = false;           ///< Views stand in the order in which they were taken.
  bool estimate_focal = false;              ///< Of each lens, both by one factor; its file is a start.
  bool estimate_centre = false;
  /// What the residuals ask for is estimated too, where the views can tell it; and the scales where nobody told them.
  bool estimate_by_need = false;
  double square_m = 0.0;                 ///< Side of the board's squares, to be named; 0: not known.
  std::optional<double> sigma_square_m;  ///< Of it; none: not known.
  std::optional<double> sigma_scale;     ///< Of the encoders' scales where they are held; none: not known.
  bool estimate_skew = true;             ///< Of the axes from being square to each other.
  bool reject_outliers = true;
};

/// One view after the solve.
struct HeadViewFit {
  bool used = false;
  std::string reason;   ///< Why it was not used; empty otherwise.
  double chi2 = 0.0;    ///< Corners and reading, against the rig as solved; also of a view that was left out.
  double rms_px = 0.0;  ///< Per point.
  Eigen::Vector2d reading_correction_rad =
      Eigen::Vector2d::Zero();               ///< What the rig would rather have read, less read.
  std::vector<Eigen::Vector2d> residual_px;  ///< Prediction − observation, one a corner.
  double cluster_z2 = 0.0;  ///< Its squared pull on the rig over what its noise alone gives; 0: unused.
};

/// A place of the board, in the world.
struct RigBoard {
  int board = 0;
  Rigid3 world_from_board;
};

/// Beyond so many σ a cause is asked for: of thirty that are tested, one clean rig in a thousand is above.
inline constexpr double rig_cause_limit = 4.2;
/// What is estimated by need costs σ where it was not needed, and no more: one clean rig in seventy.
inline constexpr double rig_free_limit = 3.5, rig_free_joint_limit = 2.8;

/// A head that turned less about an axis is taken not to have turned about it.
inline constexpr double min_span_rad = 0.07;
/// Over so much of each axis, 20°, a rig is to be known.
inline constexpr double good_span_rad = 0.35;

/// What the views of one head cover.
struct HeadCover {
  int id = 0;
  int num_views = 0, num_boards = 0;
  Eigen::Vector2d lowest_rad = Eigen::Vector2d::Zero(), highest_rad = Eigen::Vector2d::Zero();  ///< Pan, tilt.
  int num_shared_boards = 0;  ///< Seen by another head, too.
};

/// Something that the residuals ask to be free, by how many σ, and how large it would be.
struct RigCause {
  std::string name;  ///< "head1.pan_scale", "head2.tilt once a turn", "all scales"
  double size = 0.0;
  std::string unit;
  double sigmas = 0.0;
};

/// Something that was estimated because the residuals asked for it.
struct RigFreed {
  std::string name;  ///< "head1.pan_scale", "head1.camera.f", "head2.pan_cos_rad"
  double value = 0.0, sigma = 0.0;
  double was = 0.0;  ///< As given.
};

struct RigReport {
  enum class Status {
    converged,
    too_few,     ///< Usable views.
    degenerate,  ///< A combination of parameters cannot be told; `unknown` names it.
    not_linked,  ///< A head shares no board with the others.
    degrees,     ///< The readings are degrees.
    swapped,     ///< The cameras belong to the other heads.
    mirrored,    ///< A head sees its boards from behind: its images are mirrored.
    misread,     ///< The readings are not where they belong; `misreading` says how.
    no_convergence
  };
  Status status = Status::too_few;
  Rig rig;  ///< World: the first head's camera at readings of zero. Covariance: views are clusters, and what is given
            ///< with a σ is counted.
  Eigen::MatrixXd cov_model;   ///< As rig.cov, if every corner and reading erred by itself and all given was exact.
  ClusterCovariance clusters;  ///< Views; of the parameters that are solved for.
  std::vector<Assumption> assumed;                  ///< Lenses, the square, the encoders' scales.
  std::vector<RigCause> causes;                     ///< Tested one by one, the one most asked for first.
  std::vector<RigFreed> freed;                      ///< By need.
  std::string alike;                                ///< Two causes that explain the residuals alike; empty: none.
  std::vector<Eigen::Vector2d> backlash_rad;        ///< Pan, tilt of each head, where it was estimated; 0 else.
  std::vector<Eigen::Vector2d> sigma_backlash_rad;  ///< Of it.
  double deviance = 0.0;  ///< −2 ln of the likelihood, less a constant of the views: what two solves are compared by.
  std::vector<RigBoard> boards;
  std::vector<HeadViewFit> views;    ///< One a view.
  std::vector<HeadCover> covers;     ///< One a head.
  int mirrored_head = 0;             ///< Its id, where one is.
  std::string misreading;            ///< With which change of the readings the views agree; empty: none is needed.
  std::vector<std::string> unknown;  ///< Parameters of the combination that cannot be told.
  double sigma_px = 0.0, sigma_encoder_rad = 0.0;
  bool sigma_px_is_told = false, sigma_encoder_is_told = false;  ///< By the residuals.
  double chi2 = 0.0;                                             ///< Whitened corners and reading corrections.
  int dof = 0;
  double rms_px = 0.0;  ///< Per point, of the used views.
  /// σ of where another head's camera (else the camera after a turn, against where it started) stands, over the
  /// angles covered: what the calibration is for.
  double sigma_relative_rad = 0.0, sigma_relative_m = 0.0;
  double sigma_span_rad = 0.0, sigma_span_m = 0.0;  ///< The same over good_span_rad where less is covered.
  int views_used = 0, views_dropped = 0, iterations = 0;

  [[nodiscard]] double chi2_per_dof() const { return dof > 0 ? chi2 / dof : 0.0; }
};

/// Axes, offsets and mounting of pan-tilt heads, and where they stand to each other, from views of boards that stood
/// still, by maximum likelihood; readings have noise of their own and are corrected view by view. Lenses are known.
/// Needs no first guess and does not throw on bad data: the report says how it went. `cameras`: by id of the head.
/// docs/maths/pan-tilt-heads.md. Throws Interrupted.
[[nodiscard]] RigReport calibrate_rig(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                      const std::map<int, Camera>& cameras, const RigConfig& config,
                                      const Progress& progress = {});

/// What the answer is worth, or why there is none, and what to add.
[[nodiscard]] Verdict rig_verdict(const RigReport& report, const RigConfig& config);

/// Covariance (translation, rotation; on the right) of cam_from_cam(first, second) of two heads at these readings, by
/// the covariance of the rig; of one head (the same index): of its camera against where it is at `first_rad`.
[[nodiscard]] Eigen::Matrix<double, 6, 6> relative_covariance(const Rig& rig, std::size_t first,
                                                              const Eigen::Vector2d& first_rad, std::size_t second,
                                                              const Eigen::Vector2d& second_rad);

}  // namespace alidade
