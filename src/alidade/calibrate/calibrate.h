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
  Eigen::Vector2d residual_px = Eigen::Vector2d::Zero();  ///< Predicted − observed.
  bool used = true;                                       ///< False: rejected as an outlier.
};

/// One view after the solve.
struct ViewFit {
  bool used = false;
  std::string reason;     ///< Why it was not used; empty otherwise.
  Rigid3 cam_from_board;  ///< Valid only if used.
  Eigen::Matrix<double, 6, 6> pose_cov = Eigen::Matrix<double, 6, 6>::Zero();  ///< Of the right perturbation ξ.
  double rms_px = 0.0;                  ///< RMS per point, over the used corners.
  std::vector<CornerResidual> corners;  ///< One per corner of the view.
};

/// Another lens to which a solve of the same views may converge: a further local minimum.
struct OtherLens {
  Lens lens;
  double weight = 0.0;  ///< Probability by goodness of fit; those of all other lenses and the stated one sum to 1.
};

/// The estimate. Poses, residuals and covariance refer to `camera` and `board_points`.
struct CalibrateReport {
  enum class Status { converged, no_convergence, degenerate };
  Status status = Status::degenerate;
  std::string reason;  ///< degenerate: what cannot be determined, in one sentence; empty otherwise.
  std::string to_add;  ///< degenerate: what to add.
  /// Lens, size, rms_px, and the covariance over all lens parameters: cluster-robust, because the corners of a photo
  /// share errors.
  Camera camera;
  Eigen::MatrixXd model_cov;            ///< The same if all corner errors were independent.
  ClusterCovariance clusters;           ///< Why the two differ; its clusters are the used views, in order.
  std::vector<OtherLens> other_lenses;  ///< If the views determine the centre poorly; `camera.cov` covers them.
  std::vector<ViewFit> views;
  std::vector<Eigen::Vector3d> board_points;  ///< [m] as estimated (flat: as printed).
  std::vector<double> board_sigma_z_m;        ///< σ of their z [m]; empty for a flat or given board.
  double rms_px = 0.0;                        ///< √(Σ(du²+dv²)/N) over the used corners.
  double noise_px = 0.0;                      ///< σ of one coordinate, √(Σr²/(2N − p)).
  /// The part of noise_px that the corners' own covariances do not explain, per coordinate [px]; it is added to them.
  double excess_px = 0.0;
  int num_parameters = 0;  ///< p: free lens, pose and board parameters.
  int corners_used = 0;
  int corners_dropped = 0;
  int iterations = 0;
};

/// Whether outliers are searched for; with OutlierRule::automatic that depends on whether the corners have covariances.
[[nodiscard]] bool rejects_outliers(const CalibrateConfig& config, bool have_covariances);

/// Effective noise [px] of a corner: independent corners of this σ would carry as much information as the actual ones,
/// which share errors. For planning photos.
[[nodiscard]] double shared_noise_px(const CalibrateReport& report);

/// Image size [px]: initial guess of the principal point where the views do not provide one, and range of the σ map.
struct ImageSize {
  int width_px = 0;
  int height_px = 0;
};

/// Maximum-likelihood lens parameters, board poses and board shape from views of one board. Needs no initial guess.
/// Never throws because of bad geometry: see `status`. `given_points` [m]: the board for BoardShape::given.
/// Zhang, PAMI 22(11), 2000 (initial guess); bundle adjustment with the poses eliminated per view,
/// docs/maths/board-calibration.md.
[[nodiscard]] CalibrateReport calibrate(const Board& board, std::span<const BoardView> views, ImageSize size,
                                        const CalibrateConfig& config,
                                        std::span<const Eigen::Vector3d> given_points = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
