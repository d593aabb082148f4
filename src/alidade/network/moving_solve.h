#pragma once

#include <optional>
#include <span>
#include <vector>

#include "alidade/estimation/cluster_covariance.h"
#include "alidade/estimation/progress.h"
#include "alidade/network/observation_series.h"
#include "alidade/network/path_spline.h"
#include "alidade/network/report.h"
#include "alidade/pantilt/head.h"

namespace alidade {

/// One observation as the solver takes it.
struct SolvedObservation {
  std::size_t observation = 0, head = 0;  ///< Indices among all observations, and heads.
  double t_s = 0.0;                       ///< By the camera's clock.
  Eigen::Vector2d px;
};

struct MovingProblem {
  std::vector<SolvedObservation> observations;
  std::vector<Eigen::Vector2d> readings;  ///< Of each head.
  std::vector<double> mid_s;              ///< Of each head's observations: about where its clock's rate pivots.
  std::vector<bool> placed;
  std::size_t reference = 0;                      ///< Its pose and clock are fixed.
  std::size_t scale_first = 0, scale_second = 0;  ///< Their distance is given, with this relative σ.
  double scale_m = 1.0, scale_sigma = 1e-4;
  bool clocks_are_free = false;
  std::optional<double> sigma_px;

  [[nodiscard]] Eigen::Index params_a_head() const { return clocks_are_free ? 8 : 6; }
  [[nodiscard]] Eigen::Index num_common() const;
  /// Where the head's parameters begin: pose (translation, rotation; on the right), clock, drift. −1: fixed.
  [[nodiscard]] Eigen::Index first_param(std::size_t head) const;
};

struct MovingState {
  std::vector<RigHead> heads;
  std::vector<double> offset_s, drift;  ///< Time of the rig = t − offset − drift (t − midpoint) of each camera.
  PathSpline path;

  [[nodiscard]] double rig_time(const MovingProblem& problem, std::size_t head, double t_s) const {
    return t_s - offset_s[head] - drift[head] * (t_s - problem.mid_s[head]);
  }
};

struct SolvedMoving {
  MovingState state;
  std::vector<double> sigma_px;              ///< One per head.
  std::vector<Eigen::Vector2d> residual_px;  ///< One per observation of the problem; not a number where not seen.
  std::vector<bool> used;
  Eigen::MatrixXd
      cov;  ///< Of the shared parameters, blocks of time and cameras being clusters; 0×0: cannot be determined.
  Eigen::MatrixXd cov_model;             ///< If every observation erred by itself.
  ClusterCovariance clusters;            ///< Blocks of time.
  double block_s = 0.0;                  ///< Length of one.
  std::vector<Eigen::MatrixXd> by_lens;  ///< One per head: how the shared parameters follow its lens's.
  std::vector<CameraScore> scores;       ///< Without what the files give.
  double chi2_per_dof = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// One observation's residual with its derivatives.
struct ObservationTerms {
  PathSpline::Support at;
  Eigen::Vector2d r;  ///< Prediction − observation [px].
  Eigen::Matrix<double, 2, 12> J_path;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 8> J_common;  ///< By its head's own; no columns where they are fixed.
};
/// The state's heads at their readings.
[[nodiscard]] std::vector<TurnedHead> turned_heads(const MovingProblem& problem, const MovingState& state);

/// `turned`: the state's. None where the path has no such moment, or the camera does not see it.
[[nodiscard]] std::optional<ObservationTerms> observation_terms(const MovingProblem& problem, const MovingState& state,
                                                                std::span<const TurnedHead> turned,
                                                                const SolvedObservation& observation);

/// Maximum likelihood over poses, clocks and path, with soft weights (Geman–McClure) first and without what then is
/// left outside 5 σ at the end. `start`: its spline has its control points. Rough: where another solve follows; the
/// covariance is the model's. Throws Interrupted.
[[nodiscard]] SolvedMoving solve_moving(const MovingProblem& problem, const MovingState& start,
                                        const Progress& progress, bool is_rough = false);

/// What was rejected of each camera, and whether from a moment on.
void note_rejected(const MovingProblem& problem, const SolvedMoving& solved, std::vector<LocatedCamera>& cameras);

/// Of the time in which two or more cameras saw the target, what has no path: there they do not agree.
void note_disagreement(const MovingProblem& problem, const MovingState& state,
                       std::span<const ObservationSeries> series, std::span<const double> path_t_s,
                       MovingTargetReport& report);

/// A spline through points at times: least squares, as straight as it can where there are none.
[[nodiscard]] PathSpline spline_through(std::span<const double> t_s, std::span<const Eigen::Vector3d> points,
                                        double from_s, double to_s, double knot_s);

}  // namespace alidade
