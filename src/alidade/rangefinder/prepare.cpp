#include "alidade/rangefinder/prepare.h"

#include <algorithm>
#include <cmath>

namespace alidade {
namespace {

constexpr double farthest_m = 1e5;  // no rangefinder reads beyond; keeps squares finite
constexpr double widest_px = 1e6;

bool is_sigma(double sigma) { return sigma > 0.0 && sigma < farthest_m; }

/// What is wrong with the numbers of a shot; empty if nothing.
std::string fault_of(const Shot& shot) {
  if (!(shot.range_m > 0.0 && shot.range_m < farthest_m)) return "its range is not a positive length";
  if (shot.sigma_range_m && !is_sigma(*shot.sigma_range_m)) return "the σ of its range is not positive";
  if (shot.spot && !(shot.spot->px.cwiseAbs().maxCoeff() < widest_px)) return "its spot is not a pixel";
  if (shot.spot && !shot.spot->px.allFinite()) return "its spot is not a pixel";
  if (shot.spot && shot.spot->sigma_px && !is_sigma(*shot.spot->sigma_px)) return "the σ of its spot is not positive";
  if (shot.plane) {
    const double length = shot.plane->normal_in_cam.norm();
    if (!(length > 1e-6 && length < 1e6)) return "its plane has no normal";
    if (!(std::abs(shot.plane->d_m) < farthest_m * length)) return "its plane has no distance";
    if (!shot.plane->cov.allFinite()) return "its plane has no covariance";
  }
  if (shot.pose && !(shot.pose->cam_from_board.translation.norm() < farthest_m && shot.pose->cov.allFinite() &&
                     std::abs(shot.pose->cam_from_board.rotation.norm() - 1.0) < 1e-6)) {
    return "its pose is not a rigid motion";
  }
  return "";
}

Plane normalised(const Plane& plane) {
  Plane unit = plane;
  const double length = plane.normal_in_cam.norm() * (plane.d_m > 0.0 ? -1.0 : 1.0);
  unit.normal_in_cam /= length;
  unit.d_m /= length;
  unit.cov /= length * length;
  return unit;
}

/// How the corners of a board scatter about its fit.
struct CornerFit {
  double chi2 = 0.0, sigma2_sum = 0.0;
  int dof = 0, num_corners = 0;
  bool says_nothing = true;  ///< All covariances are the identity.
};

void use_board(const Shot& shot, const Camera& camera, const RangefinderConfig& config, bool is_measured,
               std::span<const Eigen::Vector3d> points, PreparedShot& ready, CornerFit& corners, std::string& reason) {
  const auto fit = fit_board_pose(camera, *shot.board, points, config.sigma_corner_px);
  if (!fit) {
    reason = "no pose of its board fits its corners";
    return;
  }
  ready.board = &*shot.board;
  ready.pose = fit->pose;
  ready.J_pose_lens = fit->J_pose_lens;
  if (is_measured) ready.plane = plane_of(fit->pose.cam_from_board);
  corners.chi2 = fit->chi2;
  corners.dof = fit->dof;
  for (const Corner& corner : shot.board->corners) {
    corners.says_nothing = corners.says_nothing && corner.cov.isIdentity(0.0);
    corners.sigma2_sum += config.sigma_corner_px ? std::pow(*config.sigma_corner_px, 2) : 0.5 * corner.cov.trace();
    ++corners.num_corners;
  }
}

void use_plane(const Shot& shot, PreparedShot& ready) {
  if (shot.pose) {
    ready.pose = shot.pose;
    ready.plane = plane_of(shot.pose->cam_from_board);
  } else if (shot.plane) {
    ready.plane = normalised(*shot.plane);
  }
}

PreparedShot prepared(const Shot& shot, const Camera& camera, const RangefinderConfig& config, bool lens_is_free,
                      std::span<const Eigen::Vector3d> points, CornerFit& corners, std::string& reason) {
  PreparedShot ready;
  ready.range_m = shot.range_m;
  ready.sigma_range_m = shot.sigma_range_m;
  const bool uses_spot = config.method != RangefinderMethod::plane;
  const bool uses_plane = config.method != RangefinderMethod::spot;
  const bool uses_board = shot.board && (uses_plane || lens_is_free);
  if (uses_board) reason = corners_fault(*shot.board, static_cast<int>(points.size()));
  if (!reason.empty()) return ready;
  if (uses_spot && shot.spot) {
    ready.spot_ray = unproject(camera, shot.spot->px);
    if (ready.spot_ray) ready.spot_px = shot.spot->px;
    if (!ready.spot_ray) reason = "the lens sees nothing at its spot";
    if (!may_be_in_image(camera, shot.spot->px)) {
      ready.spot_px.reset();
      ready.spot_ray.reset();
      reason = "its spot is outside the image";
    }
    const Spot& spot = *shot.spot;
    ready.owns_spot_sigma = spot.sigma_px && !spot.sigma_is_least;
    ready.min_sigma_spot_px = spot.sigma_is_least ? spot.sigma_px.value_or(0.0) : 0.0;
    ready.sigma_spot_px = ready.owns_spot_sigma
                              ? *spot.sigma_px
                              : std::hypot(ready.min_sigma_spot_px, config.sigma_spot_px.value_or(guessed_sigma_px));
  }
  if (uses_board) {
    use_board(shot, camera, config, uses_plane, points, ready, corners, reason);
  } else if (uses_plane) {
    use_plane(shot, ready);
  }
  if (ready.num_rows() == 0 && reason.empty())
    reason = config.method == RangefinderMethod::spot    ? "it has no spot"
             : config.method == RangefinderMethod::plane ? "it has no board"
                                                         : "it has neither spot nor board";
  return ready;
}

/// Corners with σ that is not given, or wrongly given, get what they scatter by, each board for itself: a near one
/// shows that it is curved, a far one does not. Where a board has few corners, those of all boards together.
void scale_corners(const std::vector<CornerFit>& fits, const RangefinderConfig& config, Preparation& ready) {
  CornerFit all;
  for (const CornerFit& fit : fits) {
    all.chi2 += fit.chi2;
    all.dof += fit.dof;
    all.sigma2_sum += fit.sigma2_sum;
    all.num_corners += fit.num_corners;
    all.says_nothing = all.says_nothing && fit.says_nothing;
  }
  if (all.num_corners == 0) return;
  ready.sigma_corner_px = std::sqrt(all.sigma2_sum / all.num_corners);
  if (config.sigma_corner_px) return;
  constexpr int enough = 50;
  const auto factor_of = [&](const CornerFit& fit) {
    double factor = std::sqrt(fit.chi2 / std::max(1, fit.dof));
    if (fit.dof < enough && !fit.says_nothing) factor = std::max(1.0, factor);
    return std::max(factor, 1e-4 / ready.sigma_corner_px);  // exact corners: simulated without noise
  };
  const double factor_of_all = factor_of(all);
  double sum2 = 0.0;
  for (PreparedShot& shot : ready.problem.shots) {
    if (!shot.board) continue;
    const CornerFit& fit = fits[shot.index];
    shot.corner_factor = fit.dof >= enough ? factor_of(fit) : factor_of_all;
    sum2 += shot.corner_factor * shot.corner_factor * fit.sigma2_sum;
    shot.pose->cov *= shot.corner_factor * shot.corner_factor;
  }
  ready.sigma_corner_px = std::sqrt(sum2 / all.num_corners);
}

/// The step of readings that are all multiples of one, 10⁻³, 2·10⁻³, 5·10⁻³, 10⁻² m, …; 0 where there is none.
double step_of_readings(std::span<const Shot> shots) {
  if (shots.size() < 5) return 0.0;
  for (const double step_m : {0.1, 0.05, 0.02, 0.01, 0.005, 0.002, 0.001}) {
    const bool fits = std::all_of(shots.begin(), shots.end(), [&](const Shot& shot) {
      const double steps = shot.range_m / step_m;
      return std::abs(steps - std::round(steps)) < 1e-6;
    });
    if (fits) return step_m;
  }
  return 0.0;
}

}  // namespace

bool may_be_in_image(const Camera& camera, const Eigen::Vector2d& px) {
  constexpr double edge_px = 1.0;
  if (camera.width_px <= 0 || camera.height_px <= 0) return true;
  return px.minCoeff() > -0.5 - edge_px && px.x() < camera.width_px - 0.5 + edge_px &&
         px.y() < camera.height_px - 0.5 + edge_px;
}

Preparation prepare_shots(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                          const Camera& camera, const RangefinderConfig& config) {
  Preparation ready;
  BeamProblem& problem = ready.problem;
  problem.points_in_board = points_in_board;
  problem.model = {config.range_noise().value_or(RangeNoise{guessed_sigma_m}), config.reading_counts_twice};
  problem.sigma_corner_px = config.sigma_corner_px;
  problem.estimate_scale = config.estimate_scale;
  problem.max_iterations = config.max_iterations;
  ready.reasons.resize(shots.size());
  const bool lens_is_free = config.refine == Refine::all && !lens_prior(camera, config.refine_distortion).free.empty();
  std::vector<CornerFit> corners(shots.size());
  ready.min_sigma_range_m = step_of_readings(shots) / std::sqrt(12.0);
  for (std::size_t i = 0; i < shots.size(); ++i) {
    ready.reasons[i] = fault_of(shots[i]);
    if (!ready.reasons[i].empty()) continue;
    PreparedShot shot = prepared(shots[i], camera, config, lens_is_free, points_in_board, corners[i], ready.reasons[i]);
    shot.index = i;
    shot.used = shot.num_rows() > 0;
    if (shot.used) ready.reasons[i].clear();
    if (shot.used || shot.board) problem.shots.push_back(std::move(shot));
  }
  scale_corners(corners, config, ready);
  for (const PreparedShot& shot : problem.shots) {
    ready.knows_range_sigma = ready.knows_range_sigma && (shot.sigma_range_m || config.sigma_range_m);
    if (shot.spot_px) ready.knows_spot_sigma = ready.knows_spot_sigma && (shot.owns_spot_sigma || config.sigma_spot_px);
  }
  return ready;
}

RangefinderReport report_before_solving(const Preparation& ready, std::span<const Shot> shots,
                                        std::span<const Eigen::Vector3d> points_in_board, const Camera& camera,
                                        const RangefinderConfig& config) {
  RangefinderReport report;
  report.camera = camera;
  report.scale_by_need = config.scale_by_need;
  report.sigma_corner_px = ready.sigma_corner_px;
  report.sigma_spot_px = config.sigma_spot_px.value_or(guessed_sigma_px);
  report.spot_sigma_is_estimated = !ready.knows_spot_sigma;
  report.range_sigma_is_estimated = !ready.knows_range_sigma;
  report.shots.resize(shots.size());
  for (std::size_t i = 0; i < shots.size(); ++i) report.shots[i].reason = ready.reasons[i];
  const bool is_flat =
      std::ranges::all_of(points_in_board, [](const Eigen::Vector3d& point) { return point.z() == 0.0; });
  report.boards_behind = static_cast<int>(std::ranges::count_if(ready.problem.shots, [&](const PreparedShot& shot) {
    // z of the board points away from who sees its printed side.
    return is_flat && shot.board && shot.pose && shot.pose->cam_from_board.inverse().translation.z() > 0.0;
  }));
  report.shots_dropped = static_cast<int>(shots.size());
  return report;
}

}  // namespace alidade
