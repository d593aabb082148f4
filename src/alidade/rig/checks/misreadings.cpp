#include "alidade/rig/checks/misreadings.h"

#include <algorithm>
#include <array>
#include <set>
#include <utility>

#include "alidade/estimation/verdict.h"

namespace alidade {
namespace {

using Readings = std::vector<Eigen::Vector2d>;

/// Each view of a head, or of all, with the angles of the one before, or after.
std::vector<HeadView> shifted(std::span<const HeadView> given, std::optional<int> head, bool is_late) {
  std::vector<HeadView> views(given.begin(), given.end());
  std::vector<std::size_t> own;
  for (std::size_t v = 0; v < given.size(); ++v)
    if (!head || given[v].head == *head) own.push_back(v);
  for (std::size_t k = 0; k < own.size(); ++k)
    views[own[k]].pan_tilt_rad = given[own[(k + (is_late ? 1 : own.size() - 1)) % own.size()]].pan_tilt_rad;
  return views;
}

/// The corners of a head counted from the other end of the board: its boards seem to stand upside down.
Misreading turned_corners(std::span<const HeadView> given, int head, int than, int last) {
  Misreading turned{"the corners of head " + std::to_string(head) +
                        " are numbered from the other end of the board than those of head " + std::to_string(than) +
                        ": the views agree with them counted backwards",
                    std::vector<HeadView>(given.begin(), given.end()), true,
                    "number the corners of all heads from the same end of the board (of head " + std::to_string(head) +
                        ": " + std::to_string(last) + " - corner)"};
  for (HeadView& view : turned.views)
    if (view.head == head)
      for (Corner& corner : view.seen.corners) corner.index = last - corner.index;
  return turned;
}

/// By what the pan and the tilt angles of a head are to be multiplied, 1, 2 or ½ each, for its boards' rotations to
/// agree; fewer changes where it makes no difference.
Eigen::Vector2d factors_of(const Work& work, std::size_t head, const Readings& as_read) {
  constexpr double clearly_less = 0.5, less = 0.8;
  Eigen::Vector2d best(1.0, 1.0);
  double limit = clearly_less * mounting_of(work, head, as_read).misfit_rad;
  for (const Eigen::Vector2d& factors :
       {Eigen::Vector2d(2.0, 1.0), Eigen::Vector2d(0.5, 1.0), Eigen::Vector2d(1.0, 2.0), Eigen::Vector2d(1.0, 0.5),
        Eigen::Vector2d(2.0, 2.0), Eigen::Vector2d(0.5, 0.5), Eigen::Vector2d(2.0, 0.5), Eigen::Vector2d(0.5, 2.0)}) {
    Readings scaled = as_read;
    for (Eigen::Vector2d& reading : scaled) reading = reading.cwiseProduct(factors);
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
std::optional<Misreading> scaled_angles(const Work& work, const Readings& as_read) {
  std::vector<Eigen::Vector2d> factors;
  for (std::size_t h = 0; h < work.heads.size(); ++h) factors.push_back(factors_of(work, h, as_read));
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
  Misreading scaled{named.words + ": the views agree once this is undone",
                    std::vector<HeadView>(work.given.begin(), work.given.end()), true, named.remedy};
  for (std::size_t v = 0; v < scaled.views.size(); ++v)
    scaled.views[v].pan_tilt_rad = as_read[v].cwiseProduct(factors[work.problem.views[v].head]);
  return scaled;
}

/// Exchanged and shifted angles of all heads, or of one.
void add_angles(std::span<const HeadView> given, std::optional<int> head, std::vector<Misreading>& all) {
  const std::string of = head ? " of head " + std::to_string(*head) : "";
  std::vector<HeadView> exchanged(given.begin(), given.end());
  for (HeadView& view : exchanged)
    if (!head || view.head == *head) view.pan_tilt_rad.reverseInPlace();
  all.push_back({"pan and tilt" + of + " are exchanged: the views agree with each in the other's column",
                 std::move(exchanged), true});
  all.push_back(
      {"the angles" + of + " are those of the view before: the views agree with each row's angles one row earlier",
       shifted(given, head, true)});
  all.push_back(
      {"the angles" + of + " are those of the view after: the views agree with each row's angles one row later",
       shifted(given, head, false)});
}

}  // namespace

double rotation_misfit_rad(const Work& work, std::span<const Eigen::Vector2d> readings_rad) {
  double sum = 0.0, num = 0.0;
  for (std::size_t h = 0; h < work.heads.size(); ++h) {
    const MountingStart mounting = mounting_of(work, h, readings_rad);
    sum += mounting.misfit_rad * mounting.num_compared;
    num += mounting.num_compared;
  }
  return num > 0.0 ? sum / num : 0.0;
}

std::vector<Misreading> misreadings(const Work& work) {
  constexpr double most_left = 0.7;
  const Readings as_read = readings_of(work.given);
  std::vector<std::optional<int>> heads{std::nullopt};
  if (work.ids.size() > 1) heads.insert(heads.end(), work.ids.begin(), work.ids.end());
  std::vector<Misreading> angles;
  for (const std::optional<int> head : heads) add_angles(work.given, head, angles);
  if (auto scaled = scaled_angles(work, as_read)) angles.push_back(std::move(*scaled));
  const auto& points = work.problem.points_in_board;
  std::vector<Misreading> all;
  if (half_turn_of(points))
    for (std::size_t h = 1; h < work.ids.size(); ++h)
      all.push_back(turned_corners(work.given, work.ids[h], work.ids.front(), static_cast<int>(points.size()) - 1));
  const double misfit_rad = rotation_misfit_rad(work, as_read);
  for (Misreading& other : angles) {
    if (misfit_rad > 0.0) other.misfit_left = rotation_misfit_rad(work, readings_of(other.views)) / misfit_rad;
    if (other.misfit_left.value_or(0.0) < most_left) all.push_back(std::move(other));
  }
  return all;
}

}  // namespace alidade
