#include "alidade/rangefinder/checks/repeated_shots.h"

#include <algorithm>
#include <cmath>

#include "alidade/board/same_place.h"

namespace alidade {
namespace {

constexpr double near_px = 1.0, near_m = 1e-3, near_rad = 1e-3;

bool same_plane(const Plane& a, const Plane& b) {
  return (a.normal_in_cam - b.normal_in_cam).norm() <= near_rad && std::abs(a.d_m - b.d_m) <= near_m;
}

/// By what of the board is used: its corners, else its pose, else its plane.
bool same_board(const Shot& a, const Shot& b) {
  if (a.board || b.board) return a.board && b.board && at_one_place(*a.board, *b.board, near_px);
  if (a.pose || b.pose)
    return a.pose && b.pose && same_plane(plane_of(a.pose->cam_from_board), plane_of(b.pose->cam_from_board));
  return a.plane && b.plane && same_plane(*a.plane, *b.plane);
}

Shot averaged(std::span<const Shot> shots) {
  Shot mean = shots.front();
  const auto count = static_cast<double>(shots.size());
  double range_m = 0.0;
  Eigen::Vector2d px = Eigen::Vector2d::Zero();
  std::vector<BoardView> boards;
  for (const Shot& shot : shots) {
    range_m += shot.range_m / count;
    if (shot.spot) px += shot.spot->px / count;
    if (shot.board) boards.push_back(*shot.board);
  }
  mean.range_m = range_m;
  if (mean.spot) mean.spot->px = px;
  if (mean.board) mean.board->corners = mean_corners(boards);
  return mean;
}

}  // namespace

bool at_one_placement(const Shot& first, const Shot& shot) {
  constexpr double near_reading_m = 5e-3, near_share = 5e-3;
  if (!(std::abs(shot.range_m - first.range_m) <= std::max(near_reading_m, near_share * first.range_m))) return false;
  if (first.spot.has_value() != shot.spot.has_value()) return false;
  if (first.spot && !((first.spot->px - shot.spot->px).norm() <= near_px)) return false;
  return same_board(first, shot);
}

AveragedShots averaged_shots(std::span<const Shot> shots) {
  AveragedShots result;
  for (std::size_t first = 0, next = 0; first < shots.size(); first = next) {
    for (next = first + 1; next < shots.size() && at_one_placement(shots[first], shots[next]); ++next)
      result.repeated.push_back({shots[next].table, shots[next].line,
                                 shots[next].name + " repeats " + shots[first].name + ": averaged with it"});
    result.first.push_back(first);
    result.shots.push_back(averaged(shots.subspan(first, next - first)));
  }
  return result;
}

}  // namespace alidade
