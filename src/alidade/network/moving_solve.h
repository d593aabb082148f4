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

/// One observation in the form that the solver uses.
struct SolvedObservation {
  std::size_t observation = 0, head = 0;  ///< Indices among all observations, and heads.
  double t_s = 0.0;                       ///< On the camera's clock.
  Eigen::Vector2d px;
};

struct MovingProblem {
  std::vector<SolvedObservation> observations;
  std::vector<Eigen::Vector2d> readings;  ///< Of each head.
  std::vector<double> mid_s;              ///< Per head, of its observations: approximate pivot of its clock's rate.
  std::vector<bool> placed;
  std::size_t reference = 0;                      ///< Its pose and clock are fixed.
  std::size_t scale_first = 0, scale_second = 0;  ///< Heads at a given distance, with this relative σ.
  double scale_m = 1.0, scale_sigma = 1e-4;
  bool clocks_are_free = false;
  std::optional<double> sigma_px;

  [[nodiscard]] Eigen::Index params_a_head() const { return clocks_are_free ? 8 : 6; }
  [[nodiscard]] Eigen::Index num_common() const;
  /// Index of a head's first parameter: pose (right perturbation: translation, rotation), clock, drift. −1: fixed.
  [[nodiscard]] Eigen::Index first_param(std::size_t head) const;
};

struct MovingState {
  std::vector<RigHead> heads;
  std::vector<double> offset_s, drift;  ///< Rig time = t − offset − drift (t − midpoint) for each camera.
  PathSpline path;

  [[nodiscard]] double rig_time(const MovingProblem& problem, std::size_t head, double t_s) const {
    return t_s - offset_s[head] - drift[head] * (t_s - problem.mid_s[head]);
  }
};

struct SolvedMoving {
  MovingState state;
  std::vector<double> sigma_px;              ///< One per head.
  std::vector<Eigen::Vector2d> residual_px;  ///< One per observation of the problem; NaN where not visible.
  std::vector<bool> used;
  Eigen::MatrixXd
      cov;  ///< Of the shared parameters, clustered by blocks of time and by camera; 0×0: they are unobservable.
  Eigen::MatrixXd cov_model;             ///< For independent errors of the observations.
  ClusterCovariance clusters;            ///< Blocks of time.
  double block_s = 0.0;                  ///< Length of one.
  std::vector<Eigen::MatrixXd> by_lens;  ///< One per head: ∂ shared parameters / ∂ parameters of its lens.
  std::vector<CameraScore> scores;       ///< Without the uncertainty of the files.
  double chi2_per_dof = 0.0;
  int iterations = 0;
  bool converged = false;
};

/// One observation's residual with its derivatives.
struct ObservationTerms {
  PathSpline::Support at;
  Eigen::Vector2d r;  ///< Prediction − observation [px].
  Eigen::Matrix<double, 2, 12> J_path;
  Eigen::Matrix<double, 2, Eigen::Dynamic, 0, 2, 8> J_common;  ///< By its head's own parameters; none if fixed.
};
/// The state's heads at their readings.
[[nodiscard]] std::vector<TurnedHead> turned_heads(const MovingProblem& problem, const MovingState& state);

/// `turned`: of the state. None if the path does not cover that time, or the camera does not see it.
[[nodiscard]] std::optional<ObservationTerms> observation_terms(const MovingProblem& problem, const MovingState& state,
                                                                std::span<const TurnedHead> turned,
                                                                const SolvedObservation& observation);

/// Maximum likelihood over poses, clocks and path, first with soft weights (Geman–McClure), then without what is
/// outside 5 σ at the end. `start`: its spline has its control points. Rough: if another solve follows; the
/// covariance is the model's. Throws Interrupted.
[[nodiscard]] SolvedMoving solve_moving(const MovingProblem& problem, const MovingState& start,
                                        const Progress& progress, bool is_rough = false);

/// The rejected observations of each camera, and whether they start or end at one time.
void note_rejected(const MovingProblem& problem, const SolvedMoving& solved, std::vector<LocatedCamera>& cameras);

/// The fraction of the time observed by two or more cameras that has no path: there they do not agree.
void note_disagreement(const MovingProblem& problem, const MovingState& state,
                       std::span<const ObservationSeries> series, std::span<const double> path_t_s,
                       MovingTargetReport& report);

/// A spline through timed points: least squares, as straight as possible where there are none.
[[nodiscard]] PathSpline spline_through(std::span<const double> t_s, std::span<const Eigen::Vector3d> points,
                                        double from_s, double to_s, double knot_s);

}  // namespace alidade
