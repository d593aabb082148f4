#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/geometry/rigid3.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/pantilt/rig.h"

namespace alidade {

/// Parameters of a head that may be estimated besides head_param_names: its lens (one factor on both focal lengths, the
/// centre), and the backlash of its axes.
inline constexpr int focal_param = num_head_params, centre_x_param = num_head_params + 1,
                     centre_y_param = num_head_params + 2, pan_backlash_param = num_head_params + 3,
                     tilt_backlash_param = num_head_params + 4;
/// "pan_scale", "camera.f", "tilt_backlash_rad", …
[[nodiscard]] std::string rig_param_name(int param);

/// One view with its head and board by index.
struct RigView {
  const HeadView* view = nullptr;
  std::size_t head = 0, board = 0;
  /// Direction from which each axis reached its reading: ±½, 0 if unknown. Times the backlash, it is the excess reading
  /// of an encoder before the gears.
  Eigen::Vector2d travel = Eigen::Vector2d::Zero();
};

/// Input of the solver. The world frame is the base of head 0, which is fixed.
struct RigProblem {
  std::vector<RigView> views;
  std::span<const Eigen::Vector3d> points_in_board;
  std::vector<std::vector<int>> free;  ///< Per head: which of its parameters are estimated, ascending.
  double sigma_px = 1.0;
  double sigma_encoder_rad = 0.0;  ///< 0: readings are exact.
  double sigma_scale = 0.0;        ///< Prior σ of a free scale about one; 0: none.

  [[nodiscard]] int num_free() const;
  [[nodiscard]] bool is_free(std::size_t head, int param) const;
  /// Index of a head's first parameter among the free ones.
  [[nodiscard]] int first_free(std::size_t head) const;
};

struct RigState {
  std::vector<RigHead> heads;
  std::vector<Rigid3> world_from_board;
  std::vector<Eigen::Vector2d> corrections_rad;    ///< One per view: to be added to its reading.
  std::vector<Eigen::Vector2d> backlash_rad = {};  ///< Pan, tilt of each head; empty: none.
};
/// The readings of a view if the encoders were exact.
[[nodiscard]] Eigen::Vector2d true_reading(const RigProblem& problem, const RigState& state, std::size_t view);

/// Whitened residuals of a view: corners (two rows each), then the correction of the reading.
struct RigViewResiduals {
  Eigen::VectorXd r;
  Eigen::MatrixXd J_head;  ///< With respect to the free parameters of its head.
  Eigen::Matrix<double, Eigen::Dynamic, 6> J_board;
  Eigen::Matrix<double, Eigen::Dynamic, 2> J_correction;
};
/// None if the camera does not see a corner.
[[nodiscard]] std::optional<RigViewResiduals> view_residuals(const RigProblem& problem, const RigState& state,
                                                             std::size_t view);

/// Normal equations with the corrections eliminated view by view: heads (shared), boards, and their coupling.
struct RigSystem {
  struct ViewBlock {
    Eigen::Matrix2d E = Eigen::Matrix2d::Identity();  ///< Of the correction.
    Eigen::Matrix<double, 2, Eigen::Dynamic> E_head;
    Eigen::Matrix<double, 2, 6> E_board;
    Eigen::Vector2d g = Eigen::Vector2d::Zero();
    double chi2 = 0.0;
  };
  struct BoardBlock {
    Eigen::Matrix<double, 6, 6> V = Eigen::Matrix<double, 6, 6>::Zero();
    Eigen::Matrix<double, 6, Eigen::Dynamic> W;  ///< Board × shared parameters.
    Eigen::Matrix<double, 6, 1> g = Eigen::Matrix<double, 6, 1>::Zero();
  };
  Eigen::MatrixXd U;
  Eigen::VectorXd g;
  std::vector<BoardBlock> boards;
  std::vector<ViewBlock> views;
  double cost = 0.0;  ///< Weighted.
  int num_residuals = 0;

  /// Schur complement over the boards: the information about the heads.
  [[nodiscard]] Eigen::MatrixXd information() const;
};
/// `weights`: one per view; zero excludes it. None if a view with a weight is not completely visible.
[[nodiscard]] std::optional<RigSystem> rig_system(const RigProblem& problem, const RigState& state,
                                                  std::span<const double> weights);

struct SolvedRig {
  RigState state;
  RigSystem system;  ///< At `state`.
  bool converged = false;
  int iterations = 0;
};
/// Levenberg–Marquardt over heads, boards and corrections at these weights.
[[nodiscard]] std::optional<SolvedRig> solve_rig(const RigProblem& problem, const RigState& start,
                                                 std::span<const double> weights, int max_iterations);

/// Covariance of the free parameters; if the information is singular, none, and the names of the unobservable
/// parameters.
struct RigCovariance {
  std::optional<Eigen::MatrixXd> cov;
  std::vector<std::string> unknown;
};
[[nodiscard]] RigCovariance rig_covariance(const RigProblem& problem, const SolvedRig& solved);

/// Σ over the used views of tr cov(correction)/σ²: number of corrections that only the prior determines.
[[nodiscard]] double num_fixed_corrections(const RigProblem& problem, const SolvedRig& solved,
                                           const Eigen::MatrixXd& cov, std::span<const double> weights);

}  // namespace alidade
