#include "alidade/calibrate/solve/initial_lens.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "alidade/calibrate/solve/homography.h"
#include "alidade/calibrate/solve/start.h"

namespace alidade {
namespace {

std::vector<Eigen::Matrix3d> homographies(std::span<const BoardView> views,
                                          const std::vector<Eigen::Vector3d>& board_points) {
  std::vector<Eigen::Matrix3d> found;
  for (const BoardView& view : views) {
    std::vector<Eigen::Vector2d> on_board, px;
    for (const Corner& corner : view.corners) {
      on_board.emplace_back(board_points[static_cast<std::size_t>(corner.index)].head<2>());
      px.push_back(corner.px);
    }
    if (const auto H = fit_homography(on_board, px)) found.push_back(*H);
  }
  return found;
}

/// fx fy cx cy of every start worth trying, the most promising first.
std::vector<Eigen::Vector4d> candidates(std::span<const Eigen::Matrix3d> H, ImageSize size) {
  const Eigen::Vector2d centre(0.5 * (size.width_px - 1), 0.5 * (size.height_px - 1));
  const double extent = std::max(size.width_px, size.height_px);
  std::vector<Eigen::Vector4d> found;
  const auto add = [&](double fx, double fy, double cx, double cy) { found.emplace_back(fx, fy, cx, cy); };
  if (const auto zhang = zhang_intrinsics(H)) {
    const Eigen::Vector4d& k = *zhang;
    const bool sane = k.head<2>().minCoeff() > 0.1 * extent && k.head<2>().maxCoeff() < 50.0 * extent &&
                      (k.tail<2>() - centre).norm() < extent;
    if (sane) found.push_back(k);
  }
  if (const auto f = focal_from_vanishing_points(H, centre)) add(*f, *f, centre.x(), centre.y());
  for (const double ratio : {0.9, 0.5, 1.6, 0.3, 3.0, 6.0}) {
    add(ratio * extent, ratio * extent, centre.x(), centre.y());
  }
  return found;
}

/// By how much a focal length seen in the photos is longer than the lens': water behind a port stretches it.
double stretch_in_water(const Lens& lens) {
  const auto* port = std::get_if<Calibrated<FlatPort>>(&lens);
  return port ? port->params[13] : 1.0;  // n_water
}

/// Sum of the residuals' norms, each limited to 20 px: a fit to most corners is preferred to a mediocre fit to all.
double misfit(const BundleProblem& problem, const BundleState& state) {
  constexpr double enough_px = 20.0;
  double sum = 0.0, count = 0.0;
  for (std::size_t k = 0; k < problem.views.size(); ++k) {
    for (const Eigen::Vector2d& r : residuals_px(state, k, problem.views[k])) {
      sum += r.allFinite() ? std::min(enough_px, r.norm()) : enough_px;
      count += 1.0;
    }
  }
  return sum / std::max(1.0, count);
}

struct Trial {
  InitialLens found;
  double misfit_px = 0.0;
};

std::optional<Trial> refine(const Lens& lens, std::span<const BoardView> views,
                            const std::vector<Eigen::Vector3d>& board_points, const BundleProblem& settings) {
  Camera camera;
  camera.lens = lens;
  BundleState start{lens, {}, board_points};
  std::vector<ViewArrays> arrays;
  std::vector<std::optional<Rigid3>> poses;
  for (const BoardView& view : views) {
    const auto pose = pose_from_plane(camera, view, board_points);
    poses.push_back(pose);
    if (!pose) continue;
    start.cam_from_board.push_back(*pose);
    arrays.push_back(make_arrays(view));
  }
  if (2 * arrays.size() < views.size() || arrays.empty()) return std::nullopt;
  BundleProblem problem = settings;
  problem.shape = BoardShape::flat;
  problem.views = arrays;
  problem.prior_information.setZero();
  // A tenth of a σ is near enough for a start. From a poor one the way is longer than the usual 8 iterations.
  const BundleResult result = solve_bundle(problem, std::move(start), {.max_iterations = 60, .tolerance_sigmas = 0.1});
  const double f_min = params(result.state.lens).head<2>().minCoeff();
  if (!(f_min > 0.0)) return std::nullopt;
  std::size_t next = 0;
  for (auto& pose : poses) {
    if (pose) pose = result.state.cam_from_board[next++];
  }
  return Trial{{result.state.lens, std::move(poses)}, misfit(problem, result.state)};
}

}  // namespace

std::optional<InitialLens> initial_lens(std::span<const BoardView> views,
                                        const std::vector<Eigen::Vector3d>& board_points, ImageSize size,
                                        const Lens& held, const BundleProblem& settings) {
  const std::vector<Eigen::Matrix3d> H = homographies(views, board_points);
  std::optional<Trial> best;
  constexpr double good_px = 1.0;  // corners fit: no other start can be meant
  const double stretch = stretch_in_water(held);
  const bool nothing_to_try = settings.free_lens.empty() || settings.free_lens.front() >= 4;
  for (const Eigen::Vector4d& k : candidates(H, size)) {
    Eigen::VectorXd values = params(held);
    for (const int at : settings.free_lens) {
      if (at < 4) values[at] = at < 2 ? k[at] / stretch : k[at];
    }
    for (int at = 0; at < 4; ++at) {  // what a prior knows is the better start
      if (settings.prior_information[at] > 0.0) values[at] = settings.prior_value[at];
    }
    auto trial = refine(with_params(held, values), views, board_points, settings);
    if (trial && (!best || trial->misfit_px < best->misfit_px)) best = std::move(trial);
    if (nothing_to_try || (best && best->misfit_px < good_px)) break;
  }
  if (!best) return std::nullopt;
  if (!(best->misfit_px < good_px)) best->found.cam_from_board.assign(views.size(), std::nullopt);
  return std::move(best->found);
}

double spread_of_normals_rad(std::span<const Rigid3> cam_from_board) {
  double least = 1.0;
  for (const Rigid3& a : cam_from_board) {
    const Eigen::Vector3d normal = a.rotation * Eigen::Vector3d::UnitZ();
    for (const Rigid3& b : cam_from_board.first(std::min<std::size_t>(cam_from_board.size(), 64))) {
      least = std::min(least, std::abs(normal.dot(b.rotation * Eigen::Vector3d::UnitZ())));
    }
  }
  return std::acos(std::clamp(least, -1.0, 1.0));
}

}  // namespace alidade
