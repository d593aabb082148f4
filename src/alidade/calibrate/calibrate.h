#pragma once

#include <span>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/board/board_view.h"
#include "alidade/calibrate/config.h"
#include "alidade/camera/camera.h"
#include "alidade/estimation/cluster_covariance.h"
#include "alidade/geometry/rigid3.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// One corner of one view after the solve.
struct CornerResidual {
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< Predicted − seen.
  bool used = true;                                       ///< False: rejected as an outlier.
};

/// One view after the solve.
struct ViewFit {
  bool used = false;
  std::string reason;     ///< Why it was not used; empty otherwise.
  Rigid3 cam_from_board;  ///< Meaningful where used.
  Eigen::Matrix<double, 6, 6> pose_cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< Of the right perturbation ξ.
  double rms_px = 0.0;                                                         ///< Per point, of the used corners.
  std::vector<CornerResidual> corners;                                         ///< As many as the view has.
};

/// Another lens to which a solve of the same views may settle.
struct OtherLens {
  Lens lens;
  double weight = 0.0;  ///< How likely it is, by how well it fits; that of all and the one that is stated is 1.
};

/// What calibrate() found. Poses, residuals and covariance belong to `camera` and `board_points`.
struct CalibrateReport {
  enum class Status { converged, no_convergence, degenerate };
  Status status = Status::degenerate;
  std::string reason;  ///< degenerate: what cannot be determined, in one sentence; empty otherwise.
  std::string to_add;  ///< degenerate: what to add.
  /// Lens, size, rms_px, and the covariance over all lens parameters: cluster-robust, as a photo's corners share
  /// errors.
  Camera camera;
  Eigen::MatrixXd model_cov;            ///< The same if all corner errors were independent.
  ClusterCovariance clusters;           ///< Why the two differ; its clusters are the views in use, in order.
  std::vector<OtherLens> other_lenses;  ///< Where the views determine the centre poorly; `camera.cov` extends to them.
  std::vector<ViewFit> views;
  std::vector<Eigen::Vector3d> board_points;  ///< [m] as solved (flat: as printed).
  std::vector<double> board_sigma_z_m;        ///< σ of their z [m]; empty for a flat or given board.
  double rms_px = 0.0;                        ///< √(Σ(du²+dv²)/N) over the used corners.
  double noise_px = 0.0;                      ///< σ of one coordinate, √(Σr²/(2N − p)).
  /// The part of noise_px that the corners' own covariances do not explain, per coordinate; it is added to them. [px]
  double excess_px = 0.0;
  int num_parameters = 0;  ///< p: free lens, pose and board parameters.
  int corners_used = 0;
  int corners_dropped = 0;
  int iterations = 0;
};

/// Whether outliers are searched for, by whether the corners have covariances.
[[nodiscard]] bool rejects_outliers(const CalibrateConfig& config, bool have_covariances);

/// Effective noise [px] of a corner: independent corners of this σ would give as much information as the actual ones,
/// which share errors. For planning photos.
[[nodiscard]] double shared_noise_px(const CalibrateReport& report);

/// Image size [px]: the initial guess of the principal point where the views do not give one, and the σ map's range.
struct ImageSize {
  int width_px = 0;
  int height_px = 0;
};

/// Maximum-likelihood lens parameters, board poses and board shape of the views of one board. Needs no initial guess.
/// Never throws on bad geometry: the report says how it went. `given_points` [m]: the board for BoardShape::given.
/// Zhang, PAMI 22(11), 2000 (start); bundle adjustment with the poses eliminated per view,
/// docs/maths/board-calibration.md.
[[nodiscard]] CalibrateReport calibrate(const Board& board, std::span<const BoardView> views, ImageSize size,
                                        const CalibrateConfig& config,
                                        std::span<const Eigen::Vector3d> given_points = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
