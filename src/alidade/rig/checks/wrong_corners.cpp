#include "alidade/rig/checks/wrong_corners.h"

#include <algorithm>
#include <cmath>
#include <optional>
#include <string>
#include <utility>

#include "alidade/board/board_pose.h"
#include "alidade/estimation/median.h"
#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

constexpr double max_sigmas = 7.0, max_share_of_view = 0.2, max_share = 0.1, max_of_neighbours = 0.3;
constexpr std::size_t min_corners = 8;  // of a view: fewer do not tell which one is wrong

/// Distance of each corner from where the pose that all have puts it [px]; empty where they have none.
std::vector<double> distances_px(const Camera& camera, const BoardView& seen,
                                 std::span<const Eigen::Vector3d> points_in_board) {
  std::vector<double> distances;
  const auto fit = fit_board_pose(camera, seen, points_in_board, 1.0);
  if (!fit) return distances;
  const auto at = corner_residuals(camera, fit->pose.cam_from_board, seen, points_in_board, 1.0);
  if (!at) return distances;
  for (Eigen::Index i = 0; i + 1 < at->r.size(); i += 2) distances.push_back(at->r.segment<2>(i).norm());
  return distances;
}

/// Of the neighbours of a corner on the board, the four nearest that its view has, two are within this: two may be
/// wrong as well.
double distance_of_neighbours_px(const BoardView& seen, const std::vector<double>& distances, std::size_t of,
                                 std::span<const Eigen::Vector3d> points_in_board) {
  constexpr std::size_t num = 4;
  const auto point = [&](std::size_t i) { return points_in_board[static_cast<std::size_t>(seen.corners[i].index)]; };
  std::vector<std::pair<double, double>> near;  // how far on the board, and from its own place
  for (std::size_t i = 0; i < distances.size(); ++i)
    if (i != of) near.emplace_back((point(i) - point(of)).norm(), distances[i]);
  std::ranges::sort(near);
  std::vector<double> own;
  for (std::size_t i = 0; i < std::min(num, near.size()); ++i) own.push_back(near[i].second);
  std::ranges::sort(own);
  return own.size() < 2 ? 0.0 : own[1];
}

/// The worst corner first, the pose of the others anew after each.
struct CheckedView {
  const Camera* camera = nullptr;  ///< None: it stays as it is.
  BoardView seen;
  std::vector<double> distances;
  std::vector<std::pair<int, double>> wrong;  ///< Index on the board, distance [px].

  void drop_wrong(double max_px, std::span<const Eigen::Vector3d> points_in_board) {
    const std::size_t given = seen.corners.size() + wrong.size();
    const auto most = static_cast<std::size_t>(max_share_of_view * static_cast<double>(given));
    while (wrong.size() < most && !distances.empty()) {
      const auto worst = static_cast<std::size_t>(std::ranges::max_element(distances) - distances.begin());
      if (!(distances[worst] > max_px)) return;
      if (distance_of_neighbours_px(seen, distances, worst, points_in_board) > max_of_neighbours * distances[worst])
        return;
      wrong.emplace_back(seen.corners[worst].index, distances[worst]);
      seen.corners.erase(seen.corners.begin() + static_cast<std::ptrdiff_t>(worst));
      distances = distances_px(*camera, seen, points_in_board);
    }
  }
};

std::vector<CheckedView> checked_views(std::span<const HeadView> views,
                                       std::span<const Eigen::Vector3d> points_in_board,
                                       const std::map<int, Camera>& cameras) {
  std::vector<CheckedView> checked;
  for (const HeadView& view : views) {
    CheckedView& one = checked.emplace_back();
    one.seen = view.seen;
    const auto camera = cameras.find(view.head);
    const bool is_of_board = std::ranges::all_of(view.seen.corners, [&](const Corner& corner) {
      return corner.index >= 0 && static_cast<std::size_t>(corner.index) < points_in_board.size();
    });
    if (camera == cameras.end() || !is_of_board || view.seen.corners.size() < min_corners) continue;
    one.camera = &camera->second;
    one.distances = distances_px(camera->second, view.seen, points_in_board);
  }
  return checked;
}

/// σ of a coordinate, of half of all corners.
double typical_sigma_px(const std::vector<CheckedView>& views) {
  std::vector<double> all;
  for (const CheckedView& view : views) all.insert(all.end(), view.distances.begin(), view.distances.end());
  return median_of(std::move(all)) / rayleigh_median;
}

SkippedInput named(const CheckedView& view) {
  std::vector<std::pair<int, double>> wrong = view.wrong;
  std::ranges::sort(wrong);
  std::string corners;
  double most_px = 0.0;
  for (const auto& [index, px] : wrong) {
    corners += (corners.empty() ? "" : ", ") + std::to_string(index);
    most_px = std::max(most_px, px);
  }
  const bool is_one = wrong.size() == 1;
  return {view.seen.photo, 0,
          (is_one ? "corner " : "corners ") + corners + (is_one ? " is " : " are up to ") + text_of(most_px, 2) +
              " px from where the others put " + (is_one ? "it" : "them")};
}

}  // namespace

CheckedCorners without_wrong_corners(std::span<const HeadView> views, std::span<const Eigen::Vector3d> points_in_board,
                                     const std::map<int, Camera>& cameras) {
  constexpr int max_rounds = 4;  // what is wrong makes σ of the rest larger
  CheckedCorners result{{views.begin(), views.end()}, {}};
  std::vector<CheckedView> checked = checked_views(views, points_in_board, cameras);
  std::size_t num = 0, wrong = 0;
  for (const CheckedView& view : checked) num += view.distances.size();
  for (int round = 0; round < max_rounds; ++round) {
    const double max_px = max_sigmas * typical_sigma_px(checked);
    const std::size_t before = wrong;
    wrong = 0;
    for (CheckedView& view : checked) {
      view.drop_wrong(max_px, points_in_board);
      wrong += view.wrong.size();
    }
    if (wrong == before) break;
  }
  if (static_cast<double>(wrong) > max_share * static_cast<double>(num)) return result;
  for (std::size_t v = 0; v < checked.size(); ++v) {
    if (checked[v].wrong.empty()) continue;
    result.views[v].seen.corners = checked[v].seen.corners;
    result.wrong.push_back(named(checked[v]));
  }
  return result;
}

}  // namespace alidade
