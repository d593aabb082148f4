#include "alidade/rig/rig_start.h"

#include <Eigen/Cholesky>
#include <algorithm>
#include <cmath>
#include <limits>
#include <map>

#include "alidade/geometry/decompositions.h"
#include "alidade/rig/ray_start.h"

namespace alidade {
namespace {

constexpr double cap_rad = 0.5;  // what is farther off counts no more: a wrong view is a wrong view

using Groups = std::map<std::size_t, std::vector<TurnedView>>;  // by board

Groups groups_of(std::span<const TurnedView> views) {
  constexpr std::size_t most = 40;  // pairs are compared: enough to start with
  Groups groups;
  for (const TurnedView& view : views)
    if (groups[view.board].size() < most) groups[view.board].push_back(view);
  std::erase_if(groups, [](const auto& group) { return group.second.size() < 2; });
  return groups;
}

using Rotations = std::vector<Eigen::Quaterniond>;

/// What the encoders turn each view of a group by, where they count so.
std::vector<Rotations> base_from_tilt(const Groups& groups, double pan_scale, double tilt_scale) {
  Head head;
  head.encoder.pan_scale = pan_scale;
  head.encoder.tilt_scale = tilt_scale;
  std::vector<Rotations> turns;
  for (const auto& [board, views] : groups) {
    turns.emplace_back();
    for (const TurnedView& view : views) turns.back().push_back(world_from_cam(head, view.pan_tilt_rad).rotation);
  }
  return turns;
}

/// The board's rotation in the base, one per view.
Rotations base_from_board(const std::vector<TurnedView>& views, const Rotations& base_from_tilt,
                          const Eigen::Quaterniond& cam_from_tilt) {
  Rotations turned;
  for (std::size_t i = 0; i < views.size(); ++i)
    turned.push_back(base_from_tilt[i] * (cam_from_tilt.conjugate() * views[i].cam_from_board));
  return turned;
}

/// The one of them that the others are nearest to, and the sum of the others' capped angles from it.
std::pair<std::size_t, double> middle_of(const Rotations& turned) {
  std::pair<std::size_t, double> best{0, std::numeric_limits<double>::infinity()};
  for (std::size_t i = 0; i < turned.size(); ++i) {
    double sum = 0.0;
    for (std::size_t k = 0; k < turned.size() && sum < best.second; ++k)
      sum += std::min(cap_rad, turned[i].angularDistance(turned[k]));
    if (sum < best.second) best = {i, sum};
  }
  return best;
}

/// Not to its end beyond `limit`.
double misfit(const Groups& groups, const std::vector<Rotations>& base_from_tilt,
              const Eigen::Quaterniond& cam_from_tilt, double limit = std::numeric_limits<double>::infinity()) {
  double sum = 0.0;
  auto turns = base_from_tilt.begin();
  for (auto group = groups.begin(); group != groups.end() && sum <= limit; ++group, ++turns)
    sum += middle_of(base_from_board(group->second, *turns, cam_from_tilt)).second;
  return sum;
}

/// One robust Gauss–Newton step of the mounting: each view's rotation from its board's centre, by differences.
Eigen::Vector3d refining_step(const Groups& groups, const std::vector<Rotations>& base_from_tilt,
                              const Eigen::Quaterniond& cam_from_tilt) {
  Eigen::Matrix3d H = 1e-9 * Eigen::Matrix3d::Identity();
  Eigen::Vector3d g = Eigen::Vector3d::Zero();
  constexpr double step = 1e-5;
  auto turns = base_from_tilt.begin();
  for (const auto& [board, views] : groups) {
    const Rotations now = base_from_board(views, *turns, cam_from_tilt);
    const std::size_t middle = middle_of(now).first;
    std::array<Rotations, 3> near;
    for (int k = 0; k < 3; ++k)
      near[static_cast<std::size_t>(k)] =
          base_from_board(views, *turns, cam_from_tilt * exp_so3(step * Eigen::Vector3d::Unit(k)));
    ++turns;
    for (std::size_t i = 0; i < now.size(); ++i) {
      const Eigen::Vector3d r = log_so3(now[middle].conjugate() * now[i]);
      if (!(r.norm() < cap_rad)) continue;
      Eigen::Matrix3d J;
      for (std::size_t k = 0; k < 3; ++k)
        J.col(static_cast<int>(k)) = (log_so3(near[k][middle].conjugate() * near[k][i]) - r) / step;
      const double weight = 1.0 / std::max(0.01, r.norm());
      H += weight * J.transpose() * J;
      g += weight * J.transpose() * r;
    }
  }
  H.diagonal() *= 1.01;
  return -solve_symmetric(H, g);
}

double distance(const Rigid3& a, const Rigid3& b) {
  return std::min(1.0, (a.translation - b.translation).norm() + a.rotation.angularDistance(b.rotation));
}

/// What most of several opinions agree on.
std::optional<Rigid3> max_agreed(const std::vector<Rigid3>& opinions) {
  std::optional<Rigid3> best;
  double least = std::numeric_limits<double>::infinity();
  for (const Rigid3& opinion : opinions) {
    double sum = 0.0;
    for (const Rigid3& other : opinions) sum += distance(opinion, other);
    if (sum < least) least = sum, best = opinion;
  }
  return best;
}

using Poses = std::span<const std::optional<BoardPoseFit>>;

/// The pose of a board that no view alone determines, from single points at many angles.
std::optional<Rigid3> place_of_points(const RigProblem& problem, const std::vector<bool>& usable,
                                      const PlacedRig& placed, std::size_t board) {
  std::optional<ObservationPose> best;
  Rigid3 place;
  for (std::size_t h = 0; h < placed.has_head.size(); ++h) {
    if (!placed.has_head[h]) continue;
    const RigHead& rig_head = placed.state.heads[h];
    const auto seen = observation_pose(problem, usable, rig_head, h, board);
    if (!seen || (best && best->misfit_rad <= seen->misfit_rad)) continue;
    best = seen;
    place = rig_head.head.world_from_base * seen->base_from_board;
  }
  return best ? std::optional(place) : std::nullopt;
}

/// Each board that a located head sees and that has no pose yet.
bool place_boards(const RigProblem& problem, const std::vector<bool>& usable, Poses poses, PlacedRig& placed) {
  bool any = false;
  for (std::size_t b = 0; b < placed.has_board.size(); ++b) {
    if (placed.has_board[b]) continue;
    std::vector<Rigid3> opinions;
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      const RigView& view = problem.views[v];
      if (view.board != b || !placed.has_head[view.head] || !poses[v]) continue;
      const Rigid3 world_from_cam_v = world_from_cam(placed.state.heads[view.head].head, view.view->pan_tilt_rad);
      opinions.push_back(world_from_cam_v * poses[v]->pose.cam_from_board);
    }
    const auto place = opinions.empty() ? place_of_points(problem, usable, placed, b) : max_agreed(opinions);
    if (place) {
      placed.state.world_from_board[b] = *place;
      placed.has_board[b] = any = true;
    }
  }
  return any;
}

bool place_heads(const RigProblem& problem, const std::vector<bool>& usable, Poses poses, PlacedRig& placed) {
  bool any = false;
  for (std::size_t h = 0; h < placed.has_head.size(); ++h) {
    if (placed.has_head[h]) continue;
    Head in_own_base = placed.state.heads[h].head;
    in_own_base.world_from_base = {};
    std::vector<Rigid3> opinions;
    for (std::size_t v = 0; v < problem.views.size(); ++v) {
      const RigView& view = problem.views[v];
      if (view.head != h || !placed.has_board[view.board] || !poses[v]) continue;
      const Rigid3 base_from_cam = world_from_cam(in_own_base, view.view->pan_tilt_rad);
      const Rigid3 base_from_board_v = base_from_cam * poses[v]->pose.cam_from_board;
      opinions.push_back(placed.state.world_from_board[view.board] * base_from_board_v.inverse());
    }
    for (std::size_t b = 0; opinions.empty() && b < placed.has_board.size(); ++b) {
      const auto seen =
          placed.has_board[b] ? observation_pose(problem, usable, placed.state.heads[h], h, b) : std::nullopt;
      if (seen) opinions.push_back(placed.state.world_from_board[b] * seen->base_from_board.inverse());
    }
    if (const auto world_from_base = max_agreed(opinions)) {
      placed.state.heads[h].head.world_from_base = *world_from_base;
      placed.has_head[h] = any = true;
    }
  }
  return any;
}

}  // namespace

MountingStart mounting_start(std::span<const TurnedView> views) {
  const Groups groups = groups_of(views);
  MountingStart best;
  for (const auto& [board, group] : groups) best.num_compared += static_cast<int>(group.size());
  if (groups.empty()) return best;
  // Two encoders that count backwards are a head mounted upside down: of those that explain equally well, the one with
  // the smaller rotation, and the fewer backwards.
  constexpr double enough = 1.001;  // the smallest factor below is 0.9996
  double least = std::numeric_limits<double>::infinity();
  std::vector<Rotations> turns;
  for (const double pan_scale : {1.0, -1.0}) {
    for (const double tilt_scale : {1.0, -1.0}) {
      const std::vector<Rotations> counted = base_from_tilt(groups, pan_scale, tilt_scale);
      for (const Eigen::Quaterniond& turn : turns_of_a_cube()) {
        MountingStart trial = best;
        trial.cam_from_tilt = turn;
        trial.pan_scale = pan_scale;
        trial.tilt_scale = tilt_scale;
        const double sum = misfit(groups, counted, turn, enough * least);
        const double turned = turn.angularDistance(Eigen::Quaterniond::Identity());
        const double cost = sum * (1.0 + 1e-3 * turned - 2e-4 * (pan_scale + tilt_scale)) + 1e-6 * turned;
        if (cost < least) least = cost, best = trial, turns = counted;
      }
    }
  }
  double sum = misfit(groups, turns, best.cam_from_tilt);
  for (int i = 0; i < 15; ++i) {
    const Eigen::Vector3d step = refining_step(groups, turns, best.cam_from_tilt);
    const Eigen::Quaterniond next = (best.cam_from_tilt * exp_so3(step)).normalized();
    const double next_sum = step.allFinite() ? misfit(groups, turns, next) : sum;
    if (!(next_sum < sum)) break;
    best.cam_from_tilt = next;
    sum = next_sum;
  }
  best.misfit_rad = sum / best.num_compared;
  return best;
}

PlacedRig place_rig(const RigProblem& problem, const std::vector<RigHead>& heads, std::size_t num_boards,
                    const std::vector<bool>& usable, std::span<const std::optional<BoardPoseFit>> poses) {
  PlacedRig placed{{heads, std::vector<Rigid3>(num_boards), {}},
                   std::vector<bool>(heads.size(), false),
                   std::vector<bool>(num_boards, false)};
  placed.state.corrections_rad.assign(problem.views.size(), Eigen::Vector2d::Zero());
  if (!heads.empty()) placed.has_head[0] = true;
  bool grows = true;
  while (grows) {
    const bool has_boards = place_boards(problem, usable, poses, placed);
    const bool has_heads = place_heads(problem, usable, poses, placed);
    grows = has_boards || has_heads;
  }
  return placed;
}

}  // namespace alidade
