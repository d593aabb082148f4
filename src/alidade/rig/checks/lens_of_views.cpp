#include "alidade/rig/checks/lens_of_views.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "alidade/geometry/decompositions.h"
#include "alidade/rig/rig_given.h"

namespace alidade {
namespace {

using Eigen::Index;

/// Score and information of k1.
struct Score {
  double s = 0.0, I = 0.0;

  void add(const Work& work, std::size_t v) {
    const Camera& camera = work.heads[work.problem.views[v].head].camera;
    const Rigid3& cam_from_board = work.poses[v]->pose.cam_from_board;
    const BoardView& seen = work.given[v].seen;
    const auto& points = work.problem.points_in_board;
    const auto at = corner_residuals(camera, cam_from_board, seen, points, work.problem.sigma_px);
    if (!at) return;
    const Eigen::VectorXd lens = params(camera.lens);
    Eigen::VectorXd D(at->r.size());
    for (std::size_t i = 0; i < seen.corners.size(); ++i)
      D.segment<2>(static_cast<Index>(2 * i)) =
          by_radial_term(lens, seen.corners[i].px,
                         cam_from_board * points[static_cast<std::size_t>(seen.corners[i].index)]) /
          work.problem.sigma_px;
    const Eigen::MatrixXd J = at->J_pose;
    const Eigen::VectorXd own = D - J * solve_symmetric(J.transpose() * J, J.transpose() * D);
    s += own.dot(at->r);
    I += own.squaredNorm();
  }
};

/// Corners that do not lie on a line, and so many that they tell another board.
bool are_enough(const Work& work, std::size_t v) {
  constexpr std::size_t min_corners = 8;
  const std::vector<Corner>& corners = work.given[v].seen.corners;
  const auto& points = work.problem.points_in_board;
  const bool has_camera = std::ranges::find(work.ids, work.given[v].head) != work.ids.end();
  if (!has_camera || corners.size() < min_corners) return false;
  Eigen::Vector3d mean = Eigen::Vector3d::Zero();
  for (const Corner& corner : corners) {
    if (corner.index < 0 || static_cast<std::size_t>(corner.index) >= points.size()) return false;
    mean += points[static_cast<std::size_t>(corner.index)] / static_cast<double>(corners.size());
  }
  Eigen::Matrix3d scatter = Eigen::Matrix3d::Zero();
  for (const Corner& corner : corners) {
    const Eigen::Vector3d from_mean = points[static_cast<std::size_t>(corner.index)] - mean;
    scatter += from_mean * from_mean.transpose();
  }
  const Eigen::Vector3d squares = symmetric_eigen3(scatter).values;
  return squares[1] > 1e-4 * squares[2];
}

}  // namespace

std::optional<RigCause> lens_of_views(const Work& work) {
  std::vector<Score> scores(work.heads.size());
  for (std::size_t v = 0; v < work.given.size(); ++v)
    if (work.poses[v]) scores[work.problem.views[v].head].add(work, v);
  std::optional<RigCause> most;
  for (std::size_t h = 0; h < scores.size(); ++h) {
    if (!(scores[h].I > 0.0)) continue;
    const double sigmas = std::abs(scores[h].s) / std::sqrt(scores[h].I);
    if (most && most->sigmas >= sigmas) continue;
    most = {"head" + std::to_string(work.ids[h]) + ".camera.k1", -scores[h].s / scores[h].I, "", sigmas};
  }
  return most;
}

std::string corners_of_another_board(const Work& work) {
  std::size_t given = 0, without_pose = 0;
  for (std::size_t v = 0; v < work.given.size(); ++v) {
    if (!are_enough(work, v)) continue;
    ++given;
    without_pose += work.poses[v] ? 0 : 1;
  }
  if (given < 3 || 2 * without_pose <= given) return "";
  const auto& board = work.config.board;
  return "the corners of " + std::to_string(without_pose) + " of " + std::to_string(given) + " views do not lie as " +
         (board ? "a board of " + std::to_string(board->cols) + "x" + std::to_string(board->rows) + " has them"
                : std::string("the board's points do"));
}

}  // namespace alidade
