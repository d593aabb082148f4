#include "alidade/localize/known_pose.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <random>

#include "alidade/board/board_pose.h"
#include "alidade/geometry/decompositions.h"
#include "alidade/localize/path/path_resection.h"

namespace alidade {
namespace {

struct SeenPoints {
  BoardView view;
  std::vector<Eigen::Vector3d> points_in_board;
  double length_m = 0.0, width_m = 0.0;  ///< RMS along the longest direction, and across it,
  double depth_m = 0.0;                  ///< and across both.
  Rigid3 world_from_board;
  double sigma_m = 0.0;
};

/// The observed known points, in the frame of the plane through them.
SeenPoints seen_points(std::span<const FeatureObservation> observations, std::span<const KnownPoint> known) {
  SeenPoints seen;
  std::vector<Eigen::Vector3d> points_in_world;
  Eigen::Vector3d centre = Eigen::Vector3d::Zero();
  for (const FeatureObservation& observation : observations) {
    const auto at = std::ranges::find(known, observation.id, &KnownPoint::id);
    if (at == known.end()) continue;
    Corner corner;
    corner.index = static_cast<int>(points_in_world.size());
    corner.px = observation.px;
    seen.view.corners.push_back(corner);
    points_in_world.push_back(at->point_in_world);
    centre += at->point_in_world;
    seen.sigma_m = std::max(seen.sigma_m, at->sigma_m);
  }
  if (points_in_world.empty()) return seen;
  centre /= static_cast<double>(points_in_world.size());
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Eigen::Vector3d& point : points_in_world) scatter += (point - centre) * (point - centre).transpose();
  const SymmetricEigen3 eigen = symmetric_eigen3(scatter);
  const double num = static_cast<double>(points_in_world.size());
  seen.length_m = std::sqrt(std::max(eigen.values[2], 0.0) / num);
  seen.width_m = std::sqrt(std::max(eigen.values[1], 0.0) / num);
  seen.depth_m = std::sqrt(std::max(eigen.values[0], 0.0) / num);
  Eigen::Matrix3d axes;
  axes << eigen.vectors.col(2), eigen.vectors.col(1), eigen.vectors.col(2).cross(eigen.vectors.col(1));
  seen.world_from_board = {Eigen::Quaterniond(axes), centre};
  for (const Eigen::Vector3d& point_in_world : points_in_world)
    seen.points_in_board.push_back(seen.world_from_board.inverse() * point_in_world);
  return seen;
}

/// Converts a right perturbation of cam_from_board to position in the world and right rotation of world_from_cam.
StartHypothesis start_of(const BoardPoseFit& fit, const SeenPoints& seen, const KnownPoseConfig& config) {
  const Rigid3 board_from_cam = fit.pose.cam_from_board.inverse();
  const Eigen::Matrix3d R = fit.pose.cam_from_board.rotation.toRotationMatrix();
  const Eigen::Matrix3d turned = seen.world_from_board.rotation.toRotationMatrix();
  Eigen::Matrix<double, 6, 6> J = Eigen::Matrix<double, 6, 6>::Zero();
  J.topLeftCorner<3, 3>() = -turned;
  J.topRightCorner<3, 3>() = turned * cross_matrix(board_from_cam.translation);
  J.bottomRightCorner<3, 3>() = -R;
  StartHypothesis start;
  start.motion.world_from_cam = seen.world_from_board * board_from_cam;
  start.cov.topLeftCorner<6, 6>() = J * fit.pose.cov * J.transpose();
  start.cov.diagonal().segment<3>(6).setConstant(config.sigma_speed_m_s * config.sigma_speed_m_s);
  start.cov.diagonal().tail<3>().setConstant(config.sigma_rate_rad_s * config.sigma_rate_rad_s);
  start.cost = fit.chi2;
  return start;
}

/// σ of a pixel including that of the point itself, at the distance of the fit.
double effective_sigma_px(const Camera& camera, const BoardPoseFit& fit, double sigma_m, double sigma_px) {
  const double focal_px = params(camera.lens)[0];
  const double distance_m = fit.pose.cam_from_board.translation.norm();
  return std::hypot(sigma_px, focal_px * sigma_m / distance_m);
}

std::vector<BoardPoseFit> fits_of(const Camera& camera, const SeenPoints& seen, const BoardView& view,
                                  double sigma_px) {
  std::vector<BoardPoseFit> fits = fit_board_poses(camera, view, seen.points_in_board, sigma_px);
  if (fits.empty()) return fits;
  return fit_board_poses(camera, view, seen.points_in_board,
                         effective_sigma_px(camera, fits.front(), seen.sigma_m, sigma_px));
}

constexpr double max_pose_chi2_per_dof = 6.9;  // 99.9 % of the two degrees of freedom of four points
constexpr double max_chi2 = 13.8;              // 99.9 % of a point's two

bool agree(const std::vector<BoardPoseFit>& fits) {
  return !fits.empty() && fits.front().chi2 <= max_pose_chi2_per_dof * std::max(fits.front().dof, 2);
}

/// All observations that fit a pose.
BoardView fitting(const Camera& camera, const SeenPoints& seen, const BoardPoseFit& fit, double sigma_px) {
  const double sigma = effective_sigma_px(camera, fit, seen.sigma_m, sigma_px);
  BoardView view;
  for (const Corner& corner : seen.view.corners) {
    const auto px =
        project(camera, fit.pose.cam_from_board * seen.points_in_board[static_cast<std::size_t>(corner.index)]);
    if (px && (*px - corner.px).squaredNorm() < max_chi2 * sigma * sigma) view.corners.push_back(corner);
  }
  return view;
}

/// Random sets of four; all of them if there are few.
std::vector<std::array<std::size_t, 4>> fours_of(std::size_t num) {
  constexpr std::size_t most = 48;
  std::vector<std::array<std::size_t, 4>> fours;
  for (std::size_t a = 0; a < num; ++a)
    for (std::size_t b = a + 1; b < num; ++b)
      for (std::size_t c = b + 1; c < num; ++c)
        for (std::size_t d = c + 1; d < num; ++d) fours.push_back({a, b, c, d});
  std::mt19937_64 bits(1);
  for (std::size_t i = 0; i < std::min(most, fours.size()); ++i)
    std::swap(fours[i], fours[i + bits() % (fours.size() - i)]);
  if (fours.size() > most) fours.resize(most);
  return fours;
}

/// Minimum number that must agree on a pose: more than four out of more than five, and half of all.
std::size_t min_agreeing(std::size_t num) {
  constexpr std::size_t few = 5;
  return num <= few ? 4 : std::max<std::size_t>(few, (num + 1) / 2);
}

/// The poses on which most observations agree, if not all agree on one: RANSAC over sets of four (M. A. Fischler & R.
/// C. Bolles, "Random Sample Consensus", 1981). Four points fit chance poses.
std::vector<BoardPoseFit> agreed_poses(const Camera& camera, const SeenPoints& seen, double sigma_px) {
  const std::size_t num = seen.view.corners.size();
  BoardView best;
  for (const auto& four : fours_of(num)) {
    BoardView view;
    for (const std::size_t i : four) view.corners.push_back(seen.view.corners[i]);
    for (const BoardPoseFit& fit : fits_of(camera, seen, view, sigma_px)) {
      BoardView agreeing = fitting(camera, seen, fit, sigma_px);
      if (agreeing.corners.size() > best.corners.size()) best = std::move(agreeing);
    }
  }
  if (best.corners.size() < min_agreeing(num)) return {};
  std::vector<BoardPoseFit> fits = fits_of(camera, seen, best, sigma_px);
  if (fits.empty()) return fits;
  const BoardView again = fitting(camera, seen, fits.front(), sigma_px);
  if (again.corners.size() > best.corners.size()) fits = fits_of(camera, seen, again, sigma_px);
  return fits;
}

/// Points that are collinear within their σ: the rotation of the camera about the line, and its position, are
/// undetermined.
bool is_line(const SeenPoints& seen) {
  constexpr double certain = 3.0, wide = 0.02;
  return seen.width_m < std::max(certain * seen.sigma_m, wide * seen.length_m);
}

/// Points that are coplanar within their σ.
bool is_flat(const SeenPoints& seen) {
  constexpr double certain = 3.0, deep = 0.01;
  return seen.depth_m < std::max(certain * seen.sigma_m, deep * seen.length_m);
}

/// The observed known points as input of a resection.
std::vector<PlacedObservation> in_space(std::span<const FeatureObservation> observations,
                                        std::span<const KnownPoint> known, double sigma_px) {
  std::vector<PlacedObservation> placed;
  for (const FeatureObservation& observation : observations) {
    const auto at = std::ranges::find(known, observation.id, &KnownPoint::id);
    if (at == known.end()) continue;
    const Eigen::Matrix3d cov = at->sigma_m * at->sigma_m * Eigen::Matrix3d::Identity();
    placed.push_back({observation.px, std::max(sigma_px, observation.sigma_px), at->point_in_world, cov});
  }
  return placed;
}

/// Start at a pose, with the covariance from the observations that fit.
std::optional<StartHypothesis> start_at(const Camera& camera, std::span<const PlacedObservation> placed,
                                        const CameraResection& found, const KnownPoseConfig& config) {
  Eigen::Matrix<double, 6, 6> information = Eigen::Matrix<double, 6, 6>::Zero();
  for (std::size_t i = 0; i < placed.size(); ++i) {
    if (!found.fits[i]) continue;
    Feature feature;
    feature.values.head<3>() = placed[i].point_in_world;
    const auto view = expected_view(camera, found.world_from_cam, feature);
    if (!view) return std::nullopt;
    const Eigen::Matrix<double, 2, 3> J_point = view->J_px_feature.leftCols<3>();
    const Eigen::Matrix2d cov =
        J_point * placed[i].cov * J_point.transpose() + std::pow(placed[i].sigma_px, 2) * Eigen::Matrix2d::Identity();
    information += view->J_px_pose.transpose() * cov.inverse() * view->J_px_pose;
  }
  const Llt llt(information);
  if (!llt.is_positive()) return std::nullopt;
  StartHypothesis start;
  start.motion.world_from_cam = found.world_from_cam;
  start.cov.topLeftCorner<6, 6>() = llt.inverse();
  start.cov.diagonal().segment<3>(6).setConstant(config.sigma_speed_m_s * config.sigma_speed_m_s);
  start.cov.diagonal().tail<3>().setConstant(config.sigma_rate_rad_s * config.sigma_rate_rad_s);
  return start;
}

/// For points that are not coplanar: the poses on which enough observations agree, most likely first.
std::vector<StartHypothesis> poses_in_space(const Camera& camera, std::span<const PlacedObservation> placed,
                                            const KnownPoseConfig& config) {
  constexpr int num_draws = 60;  // with 40 % mismatches one triple in five is correct
  constexpr std::size_t max_poses = 6;
  const std::size_t num = placed.size();
  if (num < 4) return {};
  std::vector<StartHypothesis> starts;
  for (const Rigid3& begin : poses_of_threes(camera, placed, num_draws, max_poses)) {
    const std::array<Rigid3, 1> from{begin};
    const auto found = resection(camera, placed, from, max_chi2);
    if (!found || found->num_fit < min_agreeing(num)) continue;
    auto start = start_at(camera, placed, *found, config);
    if (!start) continue;
    start->cost = found->cost;
    const bool is_twice = std::ranges::any_of(starts, [&](const StartHypothesis& other) {
      const double off = (other.motion.world_from_cam.translation - found->world_from_cam.translation).norm();
      return off < 3.0 * std::sqrt(start->cov.topLeftCorner<3, 3>().trace());
    });
    if (!is_twice) starts.push_back(*start);
  }
  std::ranges::stable_sort(starts, {}, &StartHypothesis::cost);
  constexpr double other_cost = 13.8;  // worse ones are negligible
  std::erase_if(starts, [&](const StartHypothesis& each) { return each.cost > starts.front().cost + other_cost; });
  return starts;
}

}  // namespace

std::vector<StartHypothesis> poses_from_known(const Camera& camera, std::span<const FeatureObservation> observations,
                                              std::span<const KnownPoint> known, const KnownPoseConfig& config) {
  const SeenPoints seen = seen_points(observations, known);
  if (is_line(seen)) return {};
  std::vector<BoardPoseFit> fits = fits_of(camera, seen, seen.view, config.sigma_px);
  constexpr std::size_t max_for_sets = 40;  // a board's corners come from one detector: no mismatches among them
  const std::size_t num = seen.view.corners.size();
  if (!agree(fits) && num > 4 && num <= max_for_sets) fits = agreed_poses(camera, seen, config.sigma_px);
  std::erase_if(fits,
                [](const BoardPoseFit& fit) { return !(fit.chi2 <= max_pose_chi2_per_dof * std::max(fit.dof, 2)); });
  if (fits.empty() && !is_flat(seen))
    return poses_in_space(camera, in_space(observations, known, config.sigma_px), config);
  std::vector<StartHypothesis> starts;
  for (const BoardPoseFit& fit : fits) starts.push_back(start_of(fit, seen, config));
  return starts;
}

std::vector<StartHypothesis> only_where(std::vector<StartHypothesis> starts) {
  constexpr double widened = 10.0;
  for (StartHypothesis& start : starts) {
    start.cov.topLeftCorner<6, 6>() *= widened * widened;
    start.cost = 0.0;
  }
  return starts;
}

}  // namespace alidade
