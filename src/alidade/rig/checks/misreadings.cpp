#include "alidade/rig/checks/misreadings.h"

#include <algorithm>
#include <iterator>
#include <limits>
#include <utility>

#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

using Views = std::vector<HeadView>;

/// Rows of a table, by index.
struct Rows {
  std::size_t first = 0, end = 0;
  [[nodiscard]] bool contain(std::size_t row) const { return row >= first && row < end; }
};

/// Each view of a head, or of all, in these rows with the angles of the one before, or after.
Views shifted(std::span<const HeadView> given, std::optional<int> head, bool is_late, const Rows& rows) {
  Views views(given.begin(), given.end());
  std::vector<std::size_t> own;
  for (std::size_t v = 0; v < given.size(); ++v)
    if (!head || given[v].head == *head) own.push_back(v);
  for (std::size_t k = 0; k < own.size(); ++k)
    if (rows.contain(own[k]))
      views[own[k]].pan_tilt_rad = given[own[(k + (is_late ? 1 : own.size() - 1)) % own.size()]].pan_tilt_rad;
  return views;
}

/// The numbers of two heads exchanged in these rows.
Views with_heads_exchanged(const Work& work, const Rows& rows) {
  Views views(work.given.begin(), work.given.end());
  for (std::size_t v = rows.first; v < rows.end; ++v)
    views[v].head = views[v].head == work.ids[0] ? work.ids[1] : work.ids[0];
  return views;
}

/// The corners of a head counted from the other end of the board: its boards seem to stand upside down.
Misreading turned_corners(std::span<const HeadView> given, int head, int than, int last) {
  Misreading turned{"the corners of head " + std::to_string(head) +
                        " are numbered from the other end of the board than those of head " + std::to_string(than) +
                        ": the views agree with them counted backwards",
                    Views(given.begin(), given.end()), true,
                    "number the corners of all heads from the same end of the board (of head " + std::to_string(head) +
                        ": " + std::to_string(last) + " - corner)"};
  for (HeadView& view : turned.views)
    if (view.head == head)
      for (Corner& corner : view.seen.corners) corner.index = last - corner.index;
  return turned;
}

/// By what the pan and the tilt angles of a head are to be multiplied, 1, 2 or ½ each, for its boards' rotations to
/// agree; fewer changes where it makes no difference.
Eigen::Vector2d factors_of(const Work& work, std::size_t head) {
  constexpr double clearly_less = 0.5, less = 0.8;
  Eigen::Vector2d best(1.0, 1.0);
  double limit = clearly_less * mounting_of(work, head, work.given).misfit_rad;
  for (const Eigen::Vector2d& factors :
       {Eigen::Vector2d(2.0, 1.0), Eigen::Vector2d(0.5, 1.0), Eigen::Vector2d(1.0, 2.0), Eigen::Vector2d(1.0, 0.5),
        Eigen::Vector2d(2.0, 2.0), Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(2.0, 0.5), Eigen::Vector2d(0.5, 2.0)}) {
    Views scaled(work.given.begin(), work.given.end());
    for (HeadView& view : scaled) view.pan_tilt_rad = view.pan_tilt_rad.cwiseProduct(factors);
    const double misfit_rad = mounting_of(work, head, scaled).misfit_rad;
    if (misfit_rad < limit) limit = less * misfit_rad, best = factors;
  }
  return best;
}

/// What is half or twice what it should be, and how to undo it.
struct ScaledWords {
  std::string words, remedy;

  void add(const std::string& whose, double factor) {
    words += (words.empty() ? "the " : ", the ") + whose +
             (factor > 1.0 ? " are half of what the head turns" : " are twice what the head turns");
    remedy += (remedy.empty() ? "multiply the " : ", the ") + whose + (factor > 1.0 ? " by 2" : " by 0.5");
  }
};

/// Half and double angles of each axis that has them.
std::optional<Misreading> scaled_angles(const Work& work) {
  std::vector<Eigen::Vector2d> factors;
  for (std::size_t h = 0; h < work.heads.size(); ++h) factors.push_back(factors_of(work, h));
  const Eigen::Vector2d one(1.0, 1.0);
  if (std::ranges::all_of(factors, [&](const Eigen::Vector2d& own) { return own == one; })) return std::nullopt;
  ScaledWords named;
  const auto add_head = [&named](const Eigen::Vector2d& own, const std::string& of) {
    if (own.x() == own.y() && own.x() != 1.0) return named.add("angles" + of, own.x());
    for (const int axis : {0, 1})
      if (own[axis] != 1.0) named.add((axis == 0 ? "pan angles" : "tilt angles") + of, own[axis]);
  };
  const bool is_alike =
      std::ranges::all_of(factors, [&](const Eigen::Vector2d& own) { return own == factors.front(); });
  if (is_alike) add_head(factors.front(), "");
  for (std::size_t h = 0; !is_alike && h < factors.size(); ++h)
    add_head(factors[h], " of head " + std::to_string(work.ids[h]));
  Misreading scaled{named.words + ": the views agree once this is undone", Views(work.given.begin(), work.given.end()),
                    true, named.remedy};
  for (std::size_t v = 0; v < scaled.views.size(); ++v)
    scaled.views[v].pan_tilt_rad = work.given[v].pan_tilt_rad.cwiseProduct(factors[work.problem.views[v].head]);
  return scaled;
}

Misreading late_or_early(Views views, const std::string& of, bool is_late) {
  return {"the angles" + of + " are those of the view " + (is_late ? "before" : "after") +
              ": the views agree with each row's angles one row " + (is_late ? "earlier" : "later"),
          std::move(views)};
}

/// All heads, then each of several.
std::vector<std::optional<int>> all_and_each(const Work& work) {
  std::vector<std::optional<int>> heads{std::nullopt};
  if (work.ids.size() > 1) heads.insert(heads.end(), work.ids.begin(), work.ids.end());
  return heads;
}

std::string of_head(std::optional<int> head) { return head ? " of head " + std::to_string(*head) : ""; }

/// Exchanged and shifted angles of all heads, or of one.
void add_angles(const Work& work, std::optional<int> head, std::vector<Misreading>& all) {
  Views exchanged(work.given.begin(), work.given.end());
  for (HeadView& view : exchanged)
    if (!head || view.head == *head) view.pan_tilt_rad.reverseInPlace();
  all.push_back({"pan and tilt" + of_head(head) + " are exchanged: the views agree with each in the other's column",
                 std::move(exchanged), true});
  const Rows every{0, work.given.size()};
  for (const bool is_late : {true, false})
    all.push_back(late_or_early(shifted(work.given, head, is_late, every), of_head(head), is_late));
}

/// The same by positions, offsets taken as zero: over their distance from the camera.
double position_misfit_rad(const Work& work, std::span<const HeadView> views) {
  constexpr double cap_rad = 0.5;
  double sum = 0.0, num = 0.0;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    const MountingStart mounting = mounting_of(work, h, views);
    Head head;
    head.cam_from_tilt = mounting.cam_from_tilt;
    head.encoder.pan_scale = mounting.pan_scale;
    head.encoder.tilt_scale = mounting.tilt_scale;
    std::vector<std::vector<Eigen::Vector3d>> places(work.boards.size());
    for (std::size_t v = 0; v < views.size(); ++v)
      if (views[v].head == work.ids[h] && work.usable[v] && work.poses[v])
        places[work.problem.views[v].board].push_back(world_from_cam(head, views[v].pan_tilt_rad) *
                                                      work.poses[v]->pose.cam_from_board.translation);
    for (const std::vector<Eigen::Vector3d>& of_board : places) {
      double least = std::numeric_limits<double>::infinity();
      for (const Eigen::Vector3d& middle : of_board) {
        double apart = 0.0;
        for (const Eigen::Vector3d& place : of_board)
          apart += std::min(cap_rad, (place - middle).norm() / middle.norm());
        least = std::min(least, apart);
      }
      if (of_board.size() > 1) sum += least, num += static_cast<double>(of_board.size());
    }
  }
  return num > 0.0 ? sum / num : 0.0;
}

/// Heads that are exchanged stand elsewhere, perhaps rotated by little.
double pose_misfit_rad(const Work& work, std::span<const HeadView> views) {
  return rotation_misfit_rad(work, views) + position_misfit_rad(work, views);
}

/// The first or the last rows of the table that are best changed so, by how far their boards then contradict each
/// other: where the change begins, or ends, is looked for in ever smaller steps.
template <class Change, class Misfit>
Rows best_part(const Work& work, const Change& change, const Misfit& misfit) {
  const std::size_t num = work.given.size();
  Rows best{0, num};
  double least = std::numeric_limits<double>::infinity();
  const auto try_rows = [&](const Rows& rows) {
    if (rows.end > num || rows.first >= rows.end || rows.end - rows.first == num) return;
    const double misfit_rad = misfit(work, change(rows));
    if (misfit_rad < least) least = misfit_rad, best = rows;
  };
  constexpr std::size_t parts = 8;
  for (std::size_t k = 1; k < parts; ++k) {
    try_rows({k * num / parts, num});
    try_rows({0, k * num / parts});
  }
  for (std::size_t step = num / (2 * parts) + 1; step > 0; step /= 2) {
    const Rows at = best;
    const bool is_last = at.end == num;
    try_rows(is_last ? Rows{at.first - std::min(step, at.first), num} : Rows{0, at.end - std::min(step, at.end)});
    try_rows(is_last ? Rows{at.first + step, num} : Rows{0, at.end + step});
  }
  return best;
}

std::string from_to(const Work& work, const Rows& rows) {
  return " from " + work.given[rows.first].seen.photo + " to " + work.given[rows.end - 1].seen.photo;
}

/// Of a part of the table: angles shifted.
void add_parts(const Work& work, std::vector<Misreading>& all) {
  for (const std::optional<int> head : all_and_each(work)) {
    for (const bool is_late : {true, false}) {
      const auto change = [&](const Rows& rows) { return shifted(work.given, head, is_late, rows); };
      const Rows rows = best_part(work, change, rotation_misfit_rad);
      all.push_back(late_or_early(change(rows), of_head(head) + from_to(work, rows), is_late));
    }
  }
}

/// The heads' numbers exchanged in a part of the table.
std::optional<Misreading> exchanged_heads(const Work& work) {
  if (work.ids.size() != 2) return std::nullopt;
  const auto change = [&](const Rows& rows) { return with_heads_exchanged(work, rows); };
  const Rows rows = best_part(work, change, pose_misfit_rad);
  Misreading exchanged{
      "heads swapped" + from_to(work, rows) + ": the views agree with the numbers of the heads exchanged there",
      change(rows), false, "exchange the numbers in column 'head' of these views"};
  const double misfit_rad = pose_misfit_rad(work, work.given);
  if (misfit_rad > 0.0) exchanged.misfit_left = pose_misfit_rad(work, exchanged.views) / misfit_rad;
  return exchanged;
}

constexpr double most_left = 0.7;

/// Those by which the rotations of the boards agree better, and by how much.
void keep_better(const Work& work, std::vector<Misreading>& others) {
  const double misfit_rad = rotation_misfit_rad(work, work.given);
  if (!(misfit_rad > 0.0)) return;
  for (Misreading& other : others) other.misfit_left = rotation_misfit_rad(work, other.views) / misfit_rad;
  std::erase_if(others, [](const Misreading& other) { return !(*other.misfit_left < most_left); });
}

}  // namespace

double rotation_misfit_rad(const Work& work, std::span<const HeadView> views) {
  double sum = 0.0, num = 0.0;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    const MountingStart mounting = mounting_of(work, h, views);
    sum += mounting.misfit_rad * mounting.num_compared;
    num += mounting.num_compared;
  }
  return num > 0.0 ? sum / num : 0.0;
}

std::vector<Misreading> misreadings(const Work& work) {
  std::vector<Misreading> all;
  for (const std::optional<int> head : all_and_each(work)) add_angles(work, head, all);
  if (auto scaled = scaled_angles(work)) all.push_back(std::move(*scaled));
  keep_better(work, all);
  const bool is_clear =
      std::ranges::any_of(all, [](const Misreading& other) { return other.misfit_left.value_or(1.0) < clear_misfit; });
  if (!is_clear && rotation_misfit_rad(work, work.given) > 0.0) {
    std::vector<Misreading> parts;
    add_parts(work, parts);
    keep_better(work, parts);
    if (auto heads = exchanged_heads(work); heads && heads->misfit_left.value_or(1.0) < most_left)
      parts.push_back(std::move(*heads));
    all.insert(all.end(), std::make_move_iterator(parts.begin()), std::make_move_iterator(parts.end()));
  }
  const auto& points = work.problem.points_in_board;
  if (half_turn_of(points))
    for (std::size_t h = 1; h < work.ids.size(); ++h)
      all.push_back(turned_corners(work.given, work.ids[h], work.ids.front(), static_cast<int>(points.size()) - 1));
  return all;
}

}  // namespace alidade
