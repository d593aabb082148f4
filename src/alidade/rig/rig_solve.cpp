#include "alidade/rig/rig_solve.h"

#include <Eigen/Cholesky>
#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/geometry/decompositions.h"

namespace alidade {
namespace {

using Matrix6 = Eigen::Matrix<double, 6, 6>;
using Vector6 = Eigen::Matrix<double, 6, 1>;

/// Adds a view's normal equations, its correction eliminated: A − Bᵀ E⁻¹ B.
void add_view(const RigViewResiduals& at, double weight, Eigen::Index first, RigSystem::ViewBlock& view,
              RigSystem::BoardBlock& board, RigSystem& system) {
  const Eigen::Index k = at.J_head.cols();
  view.E = weight * at.J_correction.transpose() * at.J_correction;
  view.E_head = weight * at.J_correction.transpose() * at.J_head;
  view.E_board = weight * at.J_correction.transpose() * at.J_board;
  view.g = weight * at.J_correction.transpose() * at.r;
  const Eigen::Matrix2d E_inverse = view.E.inverse();
  const Eigen::MatrixXd head_follows = E_inverse * view.E_head;
  const Eigen::Matrix<double, 2, 6> board_follows = E_inverse * view.E_board;
  const Eigen::Vector2d g_follows = E_inverse * view.g;
  system.U.block(first, first, k, k) +=
      weight * at.J_head.transpose() * at.J_head - view.E_head.transpose() * head_follows;
  system.g.segment(first, k) += weight * at.J_head.transpose() * at.r - view.E_head.transpose() * g_follows;
  board.V += weight * at.J_board.transpose() * at.J_board - view.E_board.transpose() * board_follows;
  board.W.middleCols(first, k) += weight * at.J_board.transpose() * at.J_head - view.E_board.transpose() * head_follows;
  board.g += weight * at.J_board.transpose() * at.r - view.E_board.transpose() * g_follows;
}

struct Step {
  Eigen::VectorXd common;
  std::vector<Vector6> boards;
  std::vector<Eigen::Vector2d> corrections;
  double size2 = 0.0;  ///< Squared, in σ.
};

/// Steps of common and boards with the diagonals raised, corrections following them exactly.
std::optional<Step> damped_step(const RigProblem& problem, const RigSystem& system, std::span<const double> weights,
                                double damping) {
  Eigen::MatrixXd S = system.U;
  S.diagonal() *= 1.0 + damping;
  Eigen::VectorXd g = system.g;
  std::vector<Ldlt> factors(system.boards.size());
  for (std::size_t b = 0; b < system.boards.size(); ++b) {
    const auto& board = system.boards[b];
    Matrix6 V = board.V;
    V.diagonal() *= 1.0 + damping;
    if (V.isZero(0.0)) V.setIdentity();  // no view of it is used
    factors[b] = Ldlt(V);
    S.noalias() -= board.W.transpose() * factors[b].solve_each(board.W);
    g.noalias() -= board.W.transpose() * factors[b].solve(board.g);
  }
  Step step{-solve_symmetric(S, g), {}, {}, 0.0};
  step.size2 = -step.common.dot(system.g);
  for (std::size_t b = 0; b < system.boards.size(); ++b) {
    step.boards.push_back(-factors[b].solve(system.boards[b].g + system.boards[b].W * step.common));
    step.size2 -= step.boards[b].dot(system.boards[b].g);
  }
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const RigView& view = problem.views[v];
    const auto& block = system.views[v];
    step.corrections.emplace_back(0.0, 0.0);
    if (!(weights[v] > 0.0)) continue;
    const auto own = step.common.segment(problem.first_free(view.head), block.E_head.cols());
    step.corrections[v] = -block.E.inverse() * (block.g + block.E_head * own + block.E_board * step.boards[view.board]);
    step.size2 += block.g.dot(block.E.inverse() * block.g);
  }
  if (!step.common.allFinite() || !std::isfinite(step.size2)) return std::nullopt;
  return step;
}

/// Lens and backlash of a head moved by a step of one of their parameters.
void move_beside(int param, double by, RigHead& rig_head, Eigen::Vector2d& backlash_rad) {
  if (param >= pan_backlash_param) {
    backlash_rad[param - pan_backlash_param] += by;
    return;
  }
  Eigen::VectorXd lens = params(rig_head.camera.lens);
  if (param == focal_param) lens.head<2>() *= 1.0 + by;
  if (param != focal_param) lens[param == centre_x_param ? 2 : 3] += by;
  rig_head.camera.lens = with_params(rig_head.camera.lens, lens);
}

RigState moved(const RigProblem& problem, const RigState& state, const Step& step) {
  RigState next = state;
  next.backlash_rad.resize(next.heads.size(), Eigen::Vector2d::Zero());
  for (std::size_t h = 0; h < next.heads.size(); ++h) {
    HeadVector of_head = HeadVector::Zero();
    for (std::size_t k = 0; k < problem.free[h].size(); ++k) {
      const int param = problem.free[h][k];
      const double by = step.common[problem.first_free(h) + static_cast<int>(k)];
      if (param < num_head_params)
        of_head[param] = by;
      else
        move_beside(param, by, next.heads[h], next.backlash_rad[h]);
    }
    next.heads[h].head = retract(state.heads[h].head, of_head);
  }
  for (std::size_t b = 0; b < next.world_from_board.size(); ++b)
    next.world_from_board[b] = state.world_from_board[b].retract(step.boards[b]);
  for (std::size_t v = 0; v < next.corrections_rad.size(); ++v) next.corrections_rad[v] += step.corrections[v];
  return next;
}

/// The parameters that a vector of the free ones is mostly made of, by name, the largest first.
std::vector<std::string> names_of(const RigProblem& problem, const RigState& state, const Eigen::VectorXd& vector) {
  constexpr std::size_t most = 4;
  std::vector<std::pair<double, std::string>> parts;
  for (std::size_t h = 0; h < problem.free.size(); ++h) {
    for (std::size_t k = 0; k < problem.free[h].size(); ++k) {
      parts.emplace_back(-std::abs(vector[problem.first_free(h) + static_cast<int>(k)]),
                         "head" + std::to_string(state.heads[h].head.id) + "." + rig_param_name(problem.free[h][k]));
    }
  }
  std::ranges::sort(parts);
  std::vector<std::string> names;
  for (const auto& [size, name] : parts)
    if (names.size() < most && size < 0.1 * parts.front().first) names.push_back(name);
  return names;
}

/// Derivatives of a pixel, over σ, by the free parameters of its head.
void fill_row(const std::vector<int>& free, const Eigen::Matrix<double, 2, num_head_params>& by_head,
              const Eigen::Matrix2d& by_readings, const LensProjection& seen, const Camera& camera,
              const RigProblem& problem, const RigView& view, Eigen::Ref<Eigen::MatrixXd> row) {
  for (std::size_t k = 0; k < free.size(); ++k) {
    auto column = row.col(static_cast<Eigen::Index>(k));
    const int param = free[k];
    if (param < num_head_params) {
      column = by_head.col(param);
    } else if (param >= pan_backlash_param) {
      const int axis = param - pan_backlash_param;
      column = -view.travel[axis] * by_readings.col(axis);
    } else if (param == focal_param) {
      const Eigen::VectorXd lens = params(camera.lens);
      column = (lens[0] * seen.J_px_params.col(0) + lens[1] * seen.J_px_params.col(1)) / problem.sigma_px;
    } else {
      column = seen.J_px_params.col(param == centre_x_param ? 2 : 3) / problem.sigma_px;
    }
  }
}

}  // namespace

std::string rig_param_name(int param) {
  constexpr std::array<const char*, 5> beside{"camera.f", "camera.cx", "camera.cy", "pan_backlash_rad",
                                              "tilt_backlash_rad"};
  return param < num_head_params ? head_param_names[static_cast<std::size_t>(param)]
                                 : beside[static_cast<std::size_t>(param - num_head_params)];
}

Eigen::Vector2d true_reading(const RigProblem& problem, const RigState& state, std::size_t v) {
  const RigView& view = problem.views[v];
  Eigen::Vector2d reading = view.view->pan_tilt_rad + state.corrections_rad[v];
  if (view.head < state.backlash_rad.size()) reading -= view.travel.cwiseProduct(state.backlash_rad[view.head]);
  return reading;
}

bool RigProblem::is_free(std::size_t head, int param) const { return std::ranges::count(free[head], param) > 0; }

int RigProblem::first_free(std::size_t head) const {
  std::size_t first = 0;
  for (std::size_t h = 0; h < head; ++h) first += free[h].size();
  return static_cast<int>(first);
}

int RigProblem::num_free() const { return first_free(free.size()); }

namespace {

/// Of a view's rows, and the two of its correction.
RigViewResiduals zero_residuals(Eigen::Index rows, std::size_t num_free) {
  return {Eigen::VectorXd::Zero(rows + 2), Eigen::MatrixXd::Zero(rows + 2, static_cast<Eigen::Index>(num_free)),
          Eigen::Matrix<double, Eigen::Dynamic, 6>::Zero(rows + 2, 6),
          Eigen::Matrix<double, Eigen::Dynamic, 2>::Zero(rows + 2, 2)};
}

/// Exact readings: a correction of its own weight, and of nothing else, stays zero.
void add_correction(const RigProblem& problem, const Eigen::Vector2d& correction, RigViewResiduals& out) {
  const bool is_exact = !(problem.sigma_encoder_rad > 0.0);
  if (is_exact) out.J_correction.setZero();
  out.r.tail<2>() = is_exact ? Eigen::Vector2d::Zero() : Eigen::Vector2d(correction / problem.sigma_encoder_rad);
  out.J_correction.bottomRows<2>() = Eigen::Matrix2d::Identity() / (is_exact ? 1.0 : problem.sigma_encoder_rad);
}

}  // namespace

std::optional<RigViewResiduals> view_residuals(const RigProblem& problem, const RigState& state, std::size_t view) {
  const RigView& which = problem.views[view];
  const HeadView& given = *which.view;
  const RigHead& rig_head = state.heads[which.head];
  const Rigid3& world_from_board = state.world_from_board[which.board];
  const TurnedHead turned(rig_head.head, true_reading(problem, state, view));
  const Eigen::Vector4d waves = turned.reading_waves();
  const Eigen::Matrix3d world_from_board_rotation = world_from_board.rotation.toRotationMatrix();
  const Eigen::Matrix3d cam_from_board_rotation = turned.cam_from_world_rotation * world_from_board_rotation;
  std::vector<Eigen::Vector3d> points_in_cam;
  for (const Corner& corner : given.seen.corners) {
    const Eigen::Vector3d& point_in_board = problem.points_in_board[static_cast<std::size_t>(corner.index)];
    points_in_cam.push_back(
        turned.point_in_cam(world_from_board_rotation * point_in_board + world_from_board.translation));
  }
  const auto seen = project_with_jacobians(rig_head.camera, points_in_cam);
  const std::vector<int>& free = problem.free[which.head];
  RigViewResiduals out = zero_residuals(static_cast<Eigen::Index>(2 * seen.size()), free.size());
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) return std::nullopt;
    const Corner& corner = given.seen.corners[i];
    const auto row = static_cast<Eigen::Index>(2 * i);
    const Eigen::Matrix<double, 2, 3> J = seen[i]->J_px_point / problem.sigma_px;
    const Eigen::Matrix<double, 2, 3> J_in_board = J * cam_from_board_rotation;
    out.r.segment<2>(row) = (seen[i]->px - corner.px) / problem.sigma_px;
    const Eigen::Matrix2d by_readings = J * turned.J_point_readings(points_in_cam[i]);
    fill_row(free, J * turned.J_point_head(points_in_cam[i], waves), by_readings, *seen[i], rig_head.camera, problem,
             which, out.J_head.middleRows<2>(row));
    out.J_board.block<2, 3>(row, 0) = J_in_board;
    out.J_board.block<2, 3>(row, 3) =
        -J_in_board * cross_matrix(problem.points_in_board[static_cast<std::size_t>(corner.index)]);
    out.J_correction.middleRows<2>(row) = by_readings;
  }
  add_correction(problem, state.corrections_rad[view], out);
  if (!out.r.allFinite()) return std::nullopt;
  return out;
}

Eigen::MatrixXd RigSystem::information() const {
  Eigen::MatrixXd S = U;
  for (const BoardBlock& board : boards) {
    if (board.V.isZero(0.0)) continue;
    S.noalias() -= board.W.transpose() * Ldlt(board.V).solve_each(board.W);
  }
  return S;
}

namespace {

/// What is known of scales that are estimated.
void add_scale_priors(const RigProblem& problem, const RigState& state, RigSystem& system) {
  if (!(problem.sigma_scale > 0.0)) return;
  const double information = 1.0 / (problem.sigma_scale * problem.sigma_scale);
  for (std::size_t h = 0; h < problem.free.size(); ++h) {
    const Encoder& encoder = state.heads[h].head.encoder;
    for (std::size_t k = 0; k < problem.free[h].size(); ++k) {
      const int param = problem.free[h][k];
      if (param != pan_scale_param && param != tilt_scale_param) continue;
      const double scale = param == pan_scale_param ? encoder.pan_scale : encoder.tilt_scale;
      const double off = scale - std::copysign(1.0, scale);  // its sign is detected
      const int at = problem.first_free(h) + static_cast<int>(k);
      system.U(at, at) += information;
      system.g[at] += information * off;
      system.cost += information * off * off;
    }
  }
}

}  // namespace

std::optional<RigSystem> rig_system(const RigProblem& problem, const RigState& state, std::span<const double> weights) {
  const int num_free = problem.num_free();
  RigSystem system;
  system.U.setZero(num_free, num_free);
  system.g.setZero(num_free);
  system.boards.resize(state.world_from_board.size());
  system.views.resize(problem.views.size());
  for (auto& board : system.boards) board.W.setZero(6, num_free);
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    const RigView& view = problem.views[v];
    if (!(weights[v] > 0.0)) continue;
    const auto at = view_residuals(problem, state, v);
    if (!at) return std::nullopt;
    system.views[v].chi2 = at->r.squaredNorm();
    add_view(*at, weights[v], problem.first_free(view.head), system.views[v], system.boards[view.board], system);
    system.cost += weights[v] * system.views[v].chi2;
    system.num_residuals += static_cast<int>(at->r.size()) - 2;  // a correction brings a row and takes a parameter
  }
  add_scale_priors(problem, state, system);
  return system;
}

std::optional<SolvedRig> solve_rig(const RigProblem& problem, const RigState& start, std::span<const double> weights,
                                   int max_iterations) {
  auto system = rig_system(problem, start, weights);
  if (!system) return std::nullopt;
  SolvedRig solved{start, std::move(*system), max_iterations == 0, 0};
  double damping = 1e-4;
  for (int i = 0; i < max_iterations && !solved.converged; ++i) {
    solved.iterations = i + 1;
    const auto step = damped_step(problem, solved.system, weights, damping);
    if (!step) return std::nullopt;
    const bool is_small = step->size2 < 1e-8 * (1.0 + 1e-6 * solved.system.cost);  // 10⁻⁴ σ
    RigState trial = moved(problem, solved.state, *step);
    auto next = rig_system(problem, trial, weights);
    if (next && next->cost <= solved.system.cost) {
      solved.state = std::move(trial);
      solved.system = std::move(*next);
      damping = std::max(0.1 * damping, 1e-12);
      solved.converged = is_small;
    } else {
      solved.converged = is_small && next;  // no lower within rounding
      if ((damping *= 10.0) > 1e12) break;
    }
  }
  return solved;
}

namespace {

/// Of each free parameter what counts as one radian, or one metre: of a centre a focal length.
Eigen::VectorXd units_of(const RigProblem& problem, const RigState& state) {
  Eigen::VectorXd units = Eigen::VectorXd::Ones(problem.num_free());
  for (std::size_t h = 0; h < problem.free.size(); ++h) {
    for (std::size_t k = 0; k < problem.free[h].size(); ++k) {
      const int param = problem.free[h][k];
      if (param != centre_x_param && param != centre_y_param) continue;
      const Eigen::VectorXd lens = params(state.heads[h].camera.lens);
      units[problem.first_free(h) + static_cast<Eigen::Index>(k)] = lens[param == centre_x_param ? 0 : 1];
    }
  }
  return units;
}

}  // namespace

RigCovariance rig_covariance(const RigProblem& problem, const SolvedRig& solved) {
  const Eigen::MatrixXd S = solved.system.information();
  const Eigen::VectorXd units = units_of(problem, solved.state);
  const SymmetricEigen raw = symmetric_eigen(Eigen::MatrixXd(units.asDiagonal() * S * units.asDiagonal()));
  RigCovariance out;
  // A combination that is not known to 1 rad or 1 m is not known.
  if (!S.allFinite() || !(raw.values[0] > 1.0)) {
    out.unknown = names_of(problem, solved.state, raw.vectors.col(0));
    return out;
  }
  out.cov = inverse_symmetric(S);
  return out;
}

double num_fixed_corrections(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                             std::span<const double> weights) {
  double held = 0.0;
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!(weights[v] > 0.0)) continue;
    const RigView& view = problem.views[v];
    const auto& block = solved.system.views[v];
    const auto& board = solved.system.boards[view.board];
    const Eigen::Index first = problem.first_free(view.head), k = block.E_head.cols();
    const Matrix6 V_inverse = inverse_symmetric(board.V);
    const Eigen::Matrix2d E_inverse = block.E.inverse();
    // ε = −E⁻¹ (E_head h + E_board b), b = −V⁻¹ W h + what the board has of its own.
    Eigen::MatrixXd by_common = -block.E_board * V_inverse * board.W;
    by_common.middleCols(first, k) += block.E_head;
    const Eigen::Matrix2d cov_of_rest =
        by_common * cov * by_common.transpose() + block.E_board * V_inverse * block.E_board.transpose();
    held += (E_inverse + E_inverse * cov_of_rest * E_inverse).trace() /
            (problem.sigma_encoder_rad * problem.sigma_encoder_rad);
  }
  return held;
}

}  // namespace alidade
