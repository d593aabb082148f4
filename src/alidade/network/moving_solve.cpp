#include "alidade/network/moving_solve.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/network/camera_scores.h"
#include "alidade/network/moving_clusters.h"

namespace alidade {
namespace {

constexpr double sigma_drift = 2e-3;  // of a camera's clock before anything is seen
constexpr double soft_sigmas = 3.0, max_sigmas = 5.0;
// Of the cost, that a step must bring to go on: 10⁻⁵ of χ² at 10⁴ observations, 0.003 σ; where another solve follows,
// more.
constexpr double min_gain = 1e-9, min_rough_gain = 1e-6;
constexpr double not_seen = std::numeric_limits<double>::quiet_NaN();

Eigen::Vector3d centre(const MovingState& state, const MovingProblem& problem, std::size_t head) {
  return cam_centre_in_world(state.heads[head].head, problem.readings[head]);
}

struct Solver {
  const MovingProblem& problem;
  MovingState state;
  std::vector<double> sigma_px;
  std::vector<bool> used;
  double bend_weight = 1.0;  ///< 1/σ of a second difference of control points.
  bool is_rough = false;     ///< Another solve follows.
  bool is_soft = true;
  std::vector<Eigen::Vector2d> residual{};

  [[nodiscard]] double weight(double r2_whitened) const {
    if (!is_soft) return 1.0;
    const double by = 1.0 + r2_whitened / (soft_sigmas * soft_sigmas);
    return 1.0 / (by * by);
  }
  [[nodiscard]] double loss(double r2_whitened) const {
    return is_soft ? r2_whitened / (1.0 + r2_whitened / (soft_sigmas * soft_sigmas)) : r2_whitened;
  }

  [[nodiscard]] double common_cost(const MovingState& at) const {
    const double off = scale_off(at) / problem.scale_sigma;
    double sum = off * off;
    for (std::size_t k = 1; k + 1 < at.path.control.size(); ++k)
      sum += bend_weight * bend_weight *
             (at.path.control[k - 1] - 2.0 * at.path.control[k] + at.path.control[k + 1]).squaredNorm();
    if (problem.clocks_are_free)
      for (const double drift : at.drift) sum += drift * drift / (sigma_drift * sigma_drift);
    return sum;
  }
  [[nodiscard]] double scale_off(const MovingState& at) const {
    return (centre(at, problem, problem.scale_first) - centre(at, problem, problem.scale_second)).norm() /
               problem.scale_m -
           1.0;
  }

  [[nodiscard]] double cost(const MovingState& at) const {
    double sum = common_cost(at);
    const std::vector<TurnedHead> turned = turned_heads(problem, at);
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      if (!used[i]) continue;
      const SolvedObservation& observation = problem.observations[i];
      const auto support = at.path.support(at.rig_time(problem, observation.head, observation.t_s));
      const auto seen = support ? project(at.heads[observation.head].camera,
                                          turned[observation.head].point_in_cam(at.path.position(*support)))
                                : std::nullopt;
      if (seen)
        sum += loss((*seen - observation.px).squaredNorm() / std::pow(sigma_px[observation.head], 2));
      else
        sum += is_soft ? soft_sigmas * soft_sigmas : std::numeric_limits<double>::infinity();
    }
    return sum;
  }

  void add_fixed(PathSystem& system) const {
    for (std::size_t k = 1; k + 1 < state.path.control.size(); ++k) system.add_bend(state.path.control, k, bend_weight);
    Eigen::VectorXd J = Eigen::VectorXd::Zero(system.num_common());
    const Eigen::Vector3d apart =
        centre(state, problem, problem.scale_second) - centre(state, problem, problem.scale_first);
    for (const bool is_second : {false, true}) {
      const std::size_t head = is_second ? problem.scale_second : problem.scale_first;
      const Eigen::Index at = problem.first_param(head);
      if (at < 0) continue;
      const Rigid3& world_from_base = state.heads[head].head.world_from_base;
      const Eigen::Vector3d arm_in_base = world_from_base.inverse() * centre(state, problem, head);
      const Eigen::RowVector3d along_in_base =
          (apart.normalized().transpose() * world_from_base.rotation.toRotationMatrix()) * (is_second ? 1.0 : -1.0) /
          (problem.scale_m * problem.scale_sigma);
      J.segment<3>(at) = along_in_base.transpose();
      J.segment<3>(at + 3) = arm_in_base.cross(along_in_base.transpose());
    }
    system.add_common(J, scale_off(state) / problem.scale_sigma);
    if (!problem.clocks_are_free) return;
    for (std::size_t h = 0; h < state.heads.size(); ++h) {
      const Eigen::Index at = problem.first_param(h);
      if (at < 0) continue;
      J.setZero();
      J[at + 7] = 1.0 / sigma_drift;
      system.add_common(J, state.drift[h] / sigma_drift);
    }
  }

  [[nodiscard]] PathSystem system() {
    PathSystem system(state.path.control.size(), problem.num_common());
    add_fixed(system);
    residual.assign(problem.observations.size(), Eigen::Vector2d::Constant(not_seen));
    const std::vector<TurnedHead> turned = turned_heads(problem, state);
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      const SolvedObservation& observation = problem.observations[i];
      const auto terms = observation_terms(problem, state, turned, observation);
      if (!terms) continue;
      residual[i] = terms->r;
      if (!used[i]) continue;
      const double sigma = sigma_px[observation.head];
      const double by = std::sqrt(weight(terms->r.squaredNorm() / (sigma * sigma))) / sigma;
      system.add(terms->at.first, by * terms->J_path, by * terms->r,
                 std::max<Eigen::Index>(0, problem.first_param(observation.head)), by * terms->J_common);
    }
    return system;
  }

  /// The same at the solution, with what is tested of each placed camera behind the shared parameters.
  [[nodiscard]] PathSystem system_with_parts() const {
    std::vector<Eigen::Index> column(state.heads.size(), -1);
    Eigen::Index num = problem.num_common();
    for (std::size_t h = 0; h < column.size(); ++h)
      if (problem.placed[h]) column[h] = std::exchange(num, num + num_camera_parts);
    PathSystem system(state.path.control.size(), num);
    add_fixed(system);
    const std::vector<TurnedHead> turned = turned_heads(problem, state);
    for (std::size_t i = 0; i < problem.observations.size(); ++i) {
      const SolvedObservation& one = problem.observations[i];
      const auto terms = used[i] ? observation_terms(problem, state, turned, one) : std::nullopt;
      if (!terms) continue;
      const double by = 1.0 / sigma_px[one.head];
      Eigen::MatrixXd J = Eigen::MatrixXd::Zero(2, num);
      const Eigen::Index first = problem.first_param(one.head);
      if (first >= 0) J.middleCols(first, terms->J_common.cols()) = by * terms->J_common;
      J.middleCols<num_camera_parts>(column[one.head]) = by * J_px_parts(problem, state, turned, one, terms->at);
      system.add(terms->at.first, by * terms->J_path, by * terms->r, 0, J);
    }
    return system;
  }

  [[nodiscard]] MovingState moved(const PathSystem::Step& step) const {
    MovingState next = state;
    for (std::size_t k = 0; k < next.path.control.size(); ++k)
      next.path.control[k] += step.path.segment<3>(static_cast<Eigen::Index>(3 * k));
    for (std::size_t h = 0; h < next.heads.size(); ++h) {
      const Eigen::Index at = problem.first_param(h);
      if (at < 0) continue;
      Rigid3& world_from_base = next.heads[h].head.world_from_base;
      world_from_base = world_from_base.retract(step.common.segment<6>(at));
      if (!problem.clocks_are_free) continue;
      next.offset_s[h] += step.common[at + 6];
      next.drift[h] += step.common[at + 7];
    }
    return next;
  }

  /// Levenberg–Marquardt at these weights. Returns the steps taken; −1 where no step can be made.
  int descend(int max_steps, const Progress& progress) {
    double damping = 1e-4, now = cost(state);
    for (int step = 0; step < max_steps; ++step) {
      report_progress(progress, "solve", static_cast<std::size_t>(step), static_cast<std::size_t>(max_steps));
      PathSystem equations = system();
      bool is_better = false;
      double gain = 0.0;
      while (!is_better && damping < 1e8) {
        const auto found = equations.solve(damping);
        const MovingState next = found ? moved(*found) : state;
        const double then = found ? cost(next) : std::numeric_limits<double>::infinity();
        is_better = then < now;
        if (is_better) {
          gain = (now - then) / now;
          now = then;
          state = next;
        }
        damping = is_better ? std::max(1e-9, 0.1 * damping) : 10.0 * damping;
      }
      if (!is_better || gain < (is_rough ? min_rough_gain : min_gain)) return step + 1;
    }
    return max_steps;
  }

  /// Residuals are smaller than errors: the path has followed some of them.
  [[nodiscard]] double followed() const {
    std::vector<bool> touched(state.path.control.size(), false);
    for (const SolvedObservation& observation : problem.observations)
      if (const auto at = state.path.support(state.rig_time(problem, observation.head, observation.t_s)))
        touched[at->first] = true;
    const auto given = 2.0 * static_cast<double>(problem.observations.size());
    const double taken =
        3.0 * static_cast<double>(std::ranges::count(touched, true)) + static_cast<double>(problem.num_common());
    return std::sqrt(given / std::max(0.2 * given, given - taken));
  }

  /// σ of a coordinate, head by head, by the median of the residuals' lengths.
  void estimate_noise() {
    if (problem.sigma_px) return;
    const double larger = followed() / rayleigh_median;
    std::vector<double> of_heads;
    for (std::size_t h = 0; h < sigma_px.size(); ++h) {
      std::vector<double> lengths;
      for (std::size_t i = 0; i < residual.size(); ++i)
        if (problem.observations[i].head == h && residual[i].allFinite()) lengths.push_back(residual[i].norm());
      if (lengths.empty()) continue;
      sigma_px[h] = std::max(0.05, larger * median_of(std::move(lengths)));
      of_heads.push_back(sigma_px[h]);
    }
    if (of_heads.empty()) return;
    // A camera that the path follows alone would seem to have no noise, and be followed all the more.
    const double typical = median_of(std::move(of_heads));
    for (double& sigma : sigma_px) sigma = std::max(sigma, 0.5 * typical);
  }

  /// What the path accelerates, where observations constrain it: taken from the middle of the loosely constrained path.
  void estimate_acceleration() {
    std::vector<double> bends;
    for (const SolvedObservation& observation : problem.observations) {
      const auto at = state.path.support(state.rig_time(problem, observation.head, observation.t_s));
      if (!at) continue;
      const std::size_t k = at->first + 1;
      bends.push_back(
          (state.path.control[k - 1] - 2.0 * state.path.control[k] + state.path.control[k + 1]).squaredNorm() / 3.0);
    }
    if (bends.empty()) return;
    double sum = 0.0;
    std::ranges::sort(bends);
    const std::size_t most = std::max<std::size_t>(1, bends.size() * 95 / 100);
    for (std::size_t i = 0; i < most; ++i) sum += bends[i] / static_cast<double>(most);
    if (sum > 0.0) bend_weight = 1.0 / std::sqrt(2.0 * sum);
  }

  /// Steps and noise by turns until both stand still at this stiffness. Returns the steps taken.
  int settle(const Progress& progress) {
    constexpr int max_rounds = 8, max_steps = 12;
    constexpr double still = 2e-3;
    int steps = 0;
    for (int round = 0; round < max_rounds; ++round) {
      steps += descend(max_steps, progress);
      const std::vector<double> before = sigma_px;
      (void)system();
      estimate_noise();
      double change = 0.0;
      for (std::size_t h = 0; h < before.size(); ++h)
        change = std::max(change, std::abs(std::log(sigma_px[h] / before[h])));
      if (change < still) break;
    }
    return steps;
  }

  void drop_wrong() {
    for (std::size_t i = 0; i < used.size(); ++i) {
      const double sigma = sigma_px[problem.observations[i].head];
      used[i] = residual[i].norm() < max_sigmas * sigma;
    }
  }
};

void finish(Solver& solver, SolvedMoving& solved) {
  PathSystem equations = solver.system();
  solved.state = solver.state;
  solved.residual_px = solver.residual;
  solved.used = solver.used;
  solved.sigma_px = solver.sigma_px;
  double chi2 = 0.0, num = 0.0;
  for (std::size_t i = 0; i < solver.used.size(); ++i) {
    if (!solver.used[i] || !solver.residual[i].allFinite()) continue;
    chi2 += solver.residual[i].squaredNorm() / std::pow(solver.sigma_px[solver.problem.observations[i].head], 2);
    num += 2.0;
  }
  solved.chi2_per_dof = chi2 / std::max(1.0, num);
  if (!equations.solve(0.0)) return;
  const Eigen::MatrixXd& information = equations.information();
  const Ldlt ldlt(information);
  const Eigen::MatrixXd cov = ldlt.inverse();
  if (!ldlt.is_positive() || !cov.allFinite()) return;
  solved.cov = solved.cov_model = cov;
  if (solver.is_rough) return;
  MovingClusters clusters = moving_clusters(solver.problem, solved, equations.path_by_common(), cov);
  solved.cov = std::move(clusters.cov);
  solved.clusters = std::move(clusters.of_time);
  solved.block_s = clusters.block_s;
  solved.by_lens = std::move(clusters.by_lens);
  PathSystem wide = solver.system_with_parts();
  (void)wide.solve(0.0);  // singular where a lens is not determined: of that each score says
  solved.scores = camera_scores(solver.problem, solved, wide);
}

}  // namespace

Eigen::Index MovingProblem::num_common() const { return params_a_head() * (std::ranges::count(placed, true) - 1); }

Eigen::Index MovingProblem::first_param(std::size_t head) const {
  if (!placed[head] || head == reference) return -1;
  Eigen::Index before = 0;
  for (std::size_t h = 0; h < head; ++h) before += placed[h] && h != reference ? 1 : 0;
  return before * params_a_head();
}

std::vector<TurnedHead> turned_heads(const MovingProblem& problem, const MovingState& state) {
  std::vector<TurnedHead> turned;
  for (std::size_t h = 0; h < state.heads.size(); ++h) turned.emplace_back(state.heads[h].head, problem.readings[h]);
  return turned;
}

std::optional<ObservationTerms> observation_terms(const MovingProblem& problem, const MovingState& state,
                                                  std::span<const TurnedHead> turned,
                                                  const SolvedObservation& observation) {
  const auto at = state.path.support(state.rig_time(problem, observation.head, observation.t_s));
  if (!at) return std::nullopt;
  const RigHead& rig_head = state.heads[observation.head];
  const TurnedHead& head = turned[observation.head];
  const Eigen::Vector3d point = state.path.position(*at);
  const auto seen = project_with_jacobians(rig_head.camera, head.point_in_cam(point));
  if (!seen) return std::nullopt;
  const Eigen::Matrix<double, 2, 3> J_px_point = seen->J_px_point * head.cam_from_world_rotation;
  ObservationTerms terms{*at, seen->px - observation.px, {}, {}};
  for (std::size_t k = 0; k < 4; ++k)
    terms.J_path.middleCols<3>(static_cast<Eigen::Index>(3 * k)) = at->weight[k] * J_px_point;
  if (problem.first_param(observation.head) < 0) return terms;
  terms.J_common.resize(2, problem.params_a_head());
  terms.J_common.leftCols<6>() = seen->J_px_point * head.J_point_base(rig_head.head.world_from_base.inverse() * point);
  if (!problem.clocks_are_free) return terms;
  const Eigen::Vector2d by_time = J_px_point * state.path.velocity(*at);
  terms.J_common.col(6) = -by_time;
  terms.J_common.col(7) = -by_time * (observation.t_s - problem.mid_s[observation.head]);
  return terms;
}

SolvedMoving solve_moving(const MovingProblem& problem, const MovingState& start, const Progress& progress,
                          bool is_rough) {
  Solver solver{problem, start, std::vector<double>(start.heads.size(), problem.sigma_px.value_or(1.0)),
                std::vector<bool>(problem.observations.size(), true)};
  solver.is_rough = is_rough;
  SolvedMoving solved;
  // Loose: an acceleration of the path's own extent in a second.
  const double extent = [&] {
    Eigen::Vector3d low = start.path.control.front(), high = low;
    for (const Eigen::Vector3d& point : start.path.control) {
      low = low.cwiseMin(point);
      high = high.cwiseMax(point);
    }
    return (high - low).norm();
  }();
  // A power of two: what it begins with need not depend on where the path begins.
  solver.bend_weight = std::exp2(std::round(-std::log2(0.3 * extent * start.path.knot_s * start.path.knot_s)));
  (void)solver.system();
  solver.estimate_noise();
  for (int stage = 0; stage < 3; ++stage) {
    solved.iterations += solver.settle(progress);
    if (stage < 2) solver.estimate_acceleration();
  }
  solver.is_soft = false;
  constexpr int max_rounds = 6, max_steps = 40;
  for (int round = 0; round < max_rounds; ++round) {
    const std::vector<bool> before = solver.used;
    solver.drop_wrong();
    if (round > 0 && solver.used == before) break;
    const int last = solver.descend(max_steps, progress);
    solved.iterations += last;
    solved.converged = last < max_steps;
    (void)solver.system();
  }
  finish(solver, solved);
  return solved;
}

PathSpline spline_through(std::span<const double> t_s, std::span<const Eigen::Vector3d> points, double from_s,
                          double to_s, double knot_s) {
  PathSpline spline{from_s - knot_s, knot_s, {}};
  spline.control.assign(static_cast<std::size_t>((to_s - from_s) / knot_s) + 6, Eigen::Vector3d::Zero());
  PathSystem system(spline.control.size(), 0);
  for (std::size_t k = 1; k + 1 < spline.control.size(); ++k) system.add_bend(spline.control, k, 0.1);
  for (std::size_t i = 0; i < t_s.size(); ++i) {
    const auto at = spline.support(t_s[i]);
    if (!at) continue;
    for (int axes = 0; axes < 2; ++axes) {  // a residual has two rows: x with y, then z alone
      Eigen::Matrix<double, 2, 12> J = Eigen::Matrix<double, 2, 12>::Zero();
      Eigen::Vector2d r = Eigen::Vector2d::Zero();
      for (int row = 0; row < 2 - axes; ++row) {
        for (std::size_t k = 0; k < 4; ++k) J(row, static_cast<Eigen::Index>(3 * k) + 2 * axes + row) = at->weight[k];
        r[row] = -points[i][2 * axes + row];
      }
      system.add(at->first, J, r, 0, Eigen::MatrixXd(2, 0));
    }
  }
  if (const auto step = system.solve(0.0))
    for (std::size_t k = 0; k < spline.control.size(); ++k)
      spline.control[k] = step->path.segment<3>(static_cast<Eigen::Index>(3 * k));
  return spline;
}

}  // namespace alidade
