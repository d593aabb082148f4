#include "alidade/rig/rig_given.h"

#include <algorithm>
#include <cmath>

#include "alidade/rig/rig_clusters.h"

namespace alidade {
namespace {

using Eigen::Index;
constexpr double ordinary_square = 0.002, ordinary_f = 0.003, ordinary_centre_px = 2.0;

/// What is given, and how the free parameters follow it.
struct Follows {
  std::vector<Eigen::MatrixXd> lens;  ///< One per head.
  Eigen::VectorXd square;
  std::vector<Eigen::Matrix<double, Eigen::Dynamic, 2>> scales;  ///< One per head.
};

Follows follows_of(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                   const std::vector<double>& weights) {
  const std::size_t num_heads = solved.state.heads.size();
  Follows follows{{}, Eigen::VectorXd::Zero(cov.rows()), {}};
  for (std::size_t h = 0; h < num_heads; ++h) {
    follows.lens.emplace_back(Eigen::MatrixXd::Zero(cov.rows(), params(solved.state.heads[h].camera.lens).size()));
    follows.scales.emplace_back(Eigen::MatrixXd::Zero(cov.rows(), 2));
  }
  for (std::size_t v = 0; v < problem.views.size(); ++v) {
    if (!(weights[v] > 0.0)) continue;
    const auto at = view_equations(problem, solved, v);
    if (!at) continue;
    const GivenColumns columns = given_columns(problem, solved.state, v);
    const Eigen::MatrixXd pull = -cov * at->G.transpose() * at->Q.transpose();
    const std::size_t h = problem.views[v].head;
    follows.lens[h] += pull * columns.lens;
    follows.square += pull * columns.square;
    follows.scales[h].col(0) += pull * columns.pan;
    follows.scales[h].col(1) += pull * columns.tilt;
  }
  return follows;
}

/// Indices of the free parameters among the wide ones.
std::vector<Index> places_of(const RigProblem& problem, const RigProblem& wide) {
  std::vector<Index> places;
  for (std::size_t h = 0; h < problem.free.size(); ++h) {
    for (const int param : problem.free[h]) {
      const auto found = std::ranges::find(wide.free[h], param);
      places.push_back(wide.first_free(h) + (found - wide.free[h].begin()));
    }
  }
  return places;
}

Eigen::VectorXd in_wide(const RigProblem& problem, const RigProblem& wide, const Eigen::VectorXd& free) {
  Eigen::VectorXd all = Eigen::VectorXd::Zero(wide.num_free());
  all(places_of(problem, wide)) = free;
  return all;
}

/// A lens whose focal length or centre is estimated is not an assumption in that.
Camera without_estimated(Camera camera, const RigProblem& problem, std::size_t head) {
  if (camera.cov.size() == 0) return camera;
  std::vector<Index> estimated;
  if (problem.is_free(head, focal_param)) estimated = {0, 1};
  if (problem.is_free(head, centre_x_param)) estimated.push_back(2);
  if (problem.is_free(head, centre_y_param)) estimated.push_back(3);
  for (const Index k : estimated) {
    camera.cov.row(k).setZero();
    camera.cov.col(k).setZero();
  }
  return camera;
}

bool is_same(const Camera& a, const Camera& b) {
  return a.lens.index() == b.lens.index() && params(a.lens) == params(b.lens) && a.cov.rows() == b.cov.rows() &&
         a.cov == b.cov;
}

struct Filler {
  const RigProblem& problem;
  RigGiven& given;

  /// `step`: what an error of one unit does to the wide parameters.
  void add(Assumption what, const Eigen::VectorXd& step) {
    const double size = what.sigma.value_or(what.ordinary);
    given.assumed.push_back(std::move(what));
    given.moved.emplace_back(step * size);
  }

  /// What the heads and this lens, which `of` carry, share.
  void add_shared(const std::vector<RigHead>& heads, const std::vector<std::size_t>& of, const Eigen::MatrixXd& wide) {
    const Eigen::MatrixXd cov = without_estimated(heads[of.front()].camera, problem, of.front()).cov;
    const auto first = [&](std::size_t head) {
      Index place = 0;
      for (std::size_t h = 0; h < head; ++h) place += params(heads[h].camera.lens).size();
      return place;
    };
    for (const std::size_t a : of) {
      given.cov_with_lenses.middleCols(first(a), cov.cols()) = wide * cov;
      for (const std::size_t b : of) given.cov_lenses.block(first(a), first(b), cov.rows(), cov.cols()) = cov;
    }
  }

  void add_camera(const std::vector<RigHead>& heads, const std::vector<std::size_t>& of, const std::string& name,
                  const Eigen::MatrixXd& follows) {
    const std::size_t head = of.front();
    const Camera camera = without_estimated(heads[head].camera, problem, head);
    const Eigen::VectorXd values = params(camera.lens);
    Eigen::MatrixXd wide(given.wide.num_free(), follows.cols());
    for (Index k = 0; k < follows.cols(); ++k) wide.col(k) = in_wide(problem, given.wide, follows.col(k));
    const bool has_cov = camera.cov.rows() == values.size() && values.size() > 0;
    const std::string remedy = "give camera files with their covariance (alidade calibrate writes it)";
    const auto sigma = [&](Index k) -> std::optional<double> {
      if (!has_cov) return std::nullopt;
      return std::sqrt(std::max(0.0, camera.cov(k, k)));
    };
    // Both focal lengths err together where nothing is known of them.
    const Eigen::VectorXd by_f =
        has_cov ? Eigen::VectorXd(wide.col(0)) : Eigen::VectorXd(wide.col(0) + values[1] / values[0] * wide.col(1));
    if (!problem.is_free(head, focal_param))
      add({.name = name + ".fx",
           .value = values[0],
           .sigma = sigma(0),
           .ordinary = ordinary_f * values[0],
           .remedy = remedy},
          by_f);
    for (const Index k : {Index{2}, Index{3}})
      if (!problem.is_free(head, k == 2 ? centre_x_param : centre_y_param))
        add({.name = name + (k == 2 ? ".cx" : ".cy"),
             .value = values[k],
             .sigma = sigma(k),
             .ordinary = ordinary_centre_px,
             .remedy = remedy},
            wide.col(k));
    if (!has_cov) return;
    given.cov += wide * camera.cov * wide.transpose();
    add_shared(heads, of, wide);
  }

  [[nodiscard]] bool frees_lens(std::size_t head) const {
    return problem.is_free(head, focal_param) || problem.is_free(head, centre_x_param) ||
           problem.is_free(head, centre_y_param);
  }

  void add_cameras(const std::vector<RigHead>& heads, const Follows& follows) {
    std::vector<bool> is_done(heads.size(), false);
    for (std::size_t h = 0; h < heads.size(); ++h) {
      if (is_done[h]) continue;
      Eigen::MatrixXd sum = follows.lens[h];
      std::vector<std::size_t> same{h};
      for (std::size_t k = h + 1; k < heads.size(); ++k) {
        if (!is_same(heads[h].camera, heads[k].camera) || frees_lens(h) || frees_lens(k)) continue;
        is_done[k] = true;
        same.push_back(k);
        sum += follows.lens[k];
      }
      const std::string of = same.size() > 1 ? "" : "head" + std::to_string(heads[h].head.id) + ".";
      add_camera(heads, same, of + "camera", sum);
    }
  }

  void add_square(const RigConfig& config, const Follows& follows) {
    const double square_m = config.board ? config.board->square_m : 1.0;
    const Eigen::VectorXd step = in_wide(problem, given.wide, follows.square) / square_m;
    add({.name = "square_m",
         .value = config.board ? square_m : std::nan(""),
         .sigma = config.sigma_square_m,
         .ordinary = ordinary_square * square_m,
         .remedy = "give --sigma-square"},
        step);
    if (config.sigma_square_m) given.cov += std::pow(*config.sigma_square_m, 2) * step * step.transpose();
  }

  void add_scales(const std::vector<RigHead>& heads, const RigConfig& config, const Follows& follows) {
    const std::optional<double> sigma = counted_sigma_scale(config);
    for (std::size_t h = 0; h < heads.size(); ++h) {
      for (const int axis : {0, 1}) {
        const int param = axis == 0 ? pan_scale_param : tilt_scale_param;
        if (std::ranges::find(problem.free[h], param) != problem.free[h].end()) continue;
        Eigen::VectorXd step = in_wide(problem, given.wide, follows.scales[h].col(axis));
        const auto own = std::ranges::find(given.wide.free[h], param) - given.wide.free[h].begin();
        step[given.wide.first_free(h) + own] = 1.0;
        const Encoder& encoder = heads[h].head.encoder;
        add({.name = "head" + std::to_string(heads[h].head.id) + (axis == 0 ? ".pan_scale" : ".tilt_scale"),
             .value = axis == 0 ? encoder.pan_scale : encoder.tilt_scale,
             .sigma = sigma,
             .ordinary = ordinary_scale,
             .remedy = "give --sigma-scale, or --scales to have the encoders' scales estimated"},
            step);
        if (sigma) given.cov += std::pow(*sigma, 2) * step * step.transpose();
      }
    }
  }
};

}  // namespace

std::optional<double> counted_sigma_scale(const RigConfig& config) {
  if (!config.sigma_scale) return std::nullopt;
  const double slope_of_waves = std::sqrt(5.0);  // once and twice a turn, sine and cosine
  return std::hypot(*config.sigma_scale, slope_of_waves * config.sigma_within_turn_rad);
}

Eigen::Vector2d by_radial_term(const Eigen::VectorXd& lens, const Eigen::Vector2d& px, const Eigen::Vector3d& p) {
  return p.head<2>().squaredNorm() / (p.z() * p.z()) * (px - lens.segment<2>(2));
}

GivenColumns given_columns(const RigProblem& problem, const RigState& state, std::size_t v) {
  const RigView& which = problem.views[v];
  const HeadView& given = *which.view;
  const RigHead& rig_head = state.heads[which.head];
  const TurnedHead turned(rig_head.head, true_reading(problem, state, v));
  const Rigid3& world_from_board = state.world_from_board[which.board];
  const Eigen::Matrix3d cam_from_board_rotation =
      turned.cam_from_world_rotation * world_from_board.rotation.toRotationMatrix();
  std::vector<Eigen::Vector3d> points_in_cam;
  for (const Corner& corner : given.seen.corners)
    points_in_cam.push_back(
        turned.point_in_cam(world_from_board * problem.points_in_board[static_cast<std::size_t>(corner.index)]));
  const auto seen = project_with_jacobians(rig_head.camera, points_in_cam);
  const Eigen::VectorXd lens = params(rig_head.camera.lens);
  const auto rows = static_cast<Index>(2 * seen.size() + 2);
  GivenColumns columns{Eigen::MatrixXd::Zero(rows, lens.size()),
                       Eigen::VectorXd::Zero(rows),
                       Eigen::VectorXd::Zero(rows),
                       Eigen::VectorXd::Zero(rows),
                       Eigen::VectorXd::Zero(rows),
                       Eigen::Matrix<double, Eigen::Dynamic, 2>::Zero(rows, 2),
                       Eigen::Matrix<double, Eigen::Dynamic, 6>::Zero(rows, 6)};
  for (std::size_t i = 0; i < seen.size(); ++i) {
    if (!seen[i]) continue;
    const auto row = static_cast<Index>(2 * i);
    const Eigen::Matrix<double, 2, 3> J = seen[i]->J_px_point / problem.sigma_px;
    const Eigen::Vector3d& point_in_board =
        problem.points_in_board[static_cast<std::size_t>(given.seen.corners[i].index)];
    columns.lens.middleRows<2>(row) = seen[i]->J_px_params / problem.sigma_px;
    columns.distortion.segment<2>(row) = by_radial_term(lens, seen[i]->px, points_in_cam[i]) / problem.sigma_px;
    columns.square.segment<2>(row) = J * (cam_from_board_rotation * point_in_board);
    columns.readings.middleRows<2>(row) = J * turned.J_point_readings(points_in_cam[i]);
    const auto by_head = turned.J_point_head(points_in_cam[i]);
    columns.base.middleRows<2>(row) = J * by_head.leftCols<6>();
    columns.pan.segment<2>(row) = J * by_head.col(pan_scale_param);
    columns.tilt.segment<2>(row) = J * by_head.col(tilt_scale_param);
  }
  return columns;
}

Eigen::MatrixXd widened(const RigProblem& problem, const RigProblem& wide, const Eigen::MatrixXd& cov) {
  Eigen::MatrixXd all = Eigen::MatrixXd::Zero(wide.num_free(), wide.num_free());
  const std::vector<Index> places = places_of(problem, wide);
  all(places, places) = cov;
  return all;
}

RigGiven rig_given(const RigProblem& problem, const SolvedRig& solved, const Eigen::MatrixXd& cov,
                   const std::vector<double>& weights, const RigConfig& config) {
  RigGiven given{problem, {}, {}, {}, {}, {}};
  for (std::vector<int>& free : given.wide.free)
    for (const int param : {pan_scale_param, tilt_scale_param})
      if (std::ranges::find(free, param) == free.end()) free.insert(std::ranges::lower_bound(free, param), param);
  given.cov.setZero(given.wide.num_free(), given.wide.num_free());
  Index num_lenses = 0;
  for (const RigHead& head : solved.state.heads) num_lenses += params(head.camera.lens).size();
  given.cov_lenses.setZero(num_lenses, num_lenses);
  given.cov_with_lenses.setZero(given.wide.num_free(), num_lenses);
  const Follows follows = follows_of(problem, solved, cov, weights);
  Filler filler{problem, given};
  filler.add_cameras(solved.state.heads, follows);
  filler.add_square(config, follows);
  filler.add_scales(solved.state.heads, config, follows);
  return given;
}

}  // namespace alidade
