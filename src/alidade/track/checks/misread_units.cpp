#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <utility>

#include "alidade/estimation/median.h"
#include "alidade/geometry/degree.h"
#include "alidade/pantilt/head_view.h"
#include "alidade/track/checks/explanation.h"
#include "alidade/track/tracker.h"

namespace alidade {
namespace {

/// For one head or for all: " of head 2", "".
std::string whose(std::span<const RigHead> heads, std::optional<std::size_t> head) {
  return head ? " of head " + std::to_string(heads[*head].head.id) : "";
}

/// Readings that are correct after multiplication by `factor`.
struct AngleUnit {
  double factor;
  const char *are, *give;
};

constexpr AngleUnit degrees{degree, " in degrees", "in radians"},
    doubled{0.5, " twice what the axes turn by", "half as large"},
    halved{2.0, " half of what the axes turn by", "twice as large"},
    converted_twice{1.0 / degree, " in radians that were converted twice", "converted from degrees once"};

/// Both axes or one.
enum class Axes { both, pan, tilt };

TableMisreading misread_angles(std::span<const RigHead> heads, std::optional<std::size_t> head, Axes axes,
                               const AngleUnit& unit) {
  const auto undo = [heads, head, axes, factor = unit.factor](TargetObservation& observation) {
    if (head && observation.head != *head) return;
    const Encoder& encoder = heads[observation.head].head.encoder;
    for (const int axis : {0, 1}) {
      if (axes != Axes::both && axis != (axes == Axes::pan ? 0 : 1)) continue;
      double& reading = observation.pan_tilt_rad[axis];
      reading = factor * (reading + 2.0 * std::numbers::pi * observation.turns[axis]);
      reading = angle_near(reading, axis == 0 ? encoder.pan_zero_rad : encoder.tilt_zero_rad);
    }
  };
  const std::string of = whose(heads, head);
  const std::string which = axes == Axes::pan ? "pan angles" : axes == Axes::tilt ? "tilt angles" : "angles";
  const std::string columns = axes == Axes::pan ? "pan_rad" : axes == Axes::tilt ? "tilt_rad" : "pan_rad and tilt_rad";
  return {{which + of + unit.are + ": as such the observations fit the rig", "give " + columns + of + " " + unit.give},
          undo};
}

/// Pixels that are correct in the camera's image after enlarging theirs by `factor`.
TableMisreading misread_pixels(std::span<const RigHead> heads, std::optional<std::size_t> head, double factor) {
  const auto undo = [head, factor](TargetObservation& observation) {
    if (head && observation.head != *head) return;
    observation.px = ((observation.px.array() + 0.5) * factor - 0.5).matrix();
  };
  const Camera& camera = heads[head.value_or(0)].camera;
  const auto size = [&](double of) {
    return fmt::format("{:.0f} x {:.0f} px", camera.width_px * of, camera.height_px * of);
  };
  return {{"pixels" + whose(heads, head) + " of images of " + size(1.0 / factor) + ", not of " + size(1.0) +
               ": as such the observations fit the rig",
           "give u_px and v_px of images of the camera's size, " + size(1.0)},
          undo};
}

/// Adds the units whose factor exceeds `above`.
void add_units(std::span<const RigHead> heads, std::optional<std::size_t> head, double above,
               std::vector<TableMisreading>& all) {
  for (const AngleUnit& unit : {degrees, doubled, halved, converted_twice})
    if (unit.factor > above) all.push_back(misread_angles(heads, head, Axes::both, unit));
  for (const Axes axes : {Axes::pan, Axes::tilt})
    for (const AngleUnit& unit : {doubled, halved})
      if (unit.factor > above) all.push_back(misread_angles(heads, head, axes, unit));
  for (const double factor : {2.0, 0.5, 1.5, 2.0 / 3.0, 4.0 / 3.0, 0.75, 3.0, 1.0 / 3.0})
    if (factor > above) all.push_back(misread_pixels(heads, head, factor));
}

/// Distance by which a ray misses the intersection with another head's ray, over the range.
double miss_of(const WorldRay& a, const WorldRay& b) {
  const auto met = nearest_to_rays(a, b);
  if (!met) return std::numeric_limits<double>::infinity();
  const Eigen::Vector3d to_met = *met - a.origin_in_world;
  return a.direction_in_world.dot(to_met) > 0.0 ? a.direction_in_world.cross(to_met).norm() / to_met.norm()
                                                : std::numeric_limits<double>::infinity();
}

/// Median of miss_of(), with rays interpolated between two of a head to the time of another head's ray in between.
double median_miss(std::span<const TargetObservation> observations, std::span<const RigHead> heads, double together_s,
                   const TableMisreading& misreading) {
  constexpr double none = std::numeric_limits<double>::infinity();
  std::vector<double> misses;
  for (std::size_t i = 1; i + 1 < observations.size(); ++i) {
    std::array<TargetObservation, 3> seen{observations[i - 1], observations[i], observations[i + 1]};
    const double apart_s = seen[2].t_capture_s - seen[0].t_capture_s;
    if (seen[0].head == seen[1].head || seen[0].head != seen[2].head || !(apart_s > 0.0 && apart_s < 2.0 * together_s))
      continue;
    for (TargetObservation& each : seen) misreading.undo(each);
    auto before = ray_in_world(heads[seen[0].head], seen[0]);
    const auto at = ray_in_world(heads[seen[1].head], seen[1]), after = ray_in_world(heads[seen[2].head], seen[2]);
    misses.push_back(none);
    if (!before || !at || !after) continue;
    const double share = (seen[1].t_capture_s - seen[0].t_capture_s) / apart_s;
    before->origin_in_world += share * (after->origin_in_world - before->origin_in_world);
    before->direction_in_world += share * (after->direction_in_world - before->direction_in_world);
    before->direction_in_world.normalize();
    misses.back() = miss_of(*before, *at);
  }
  return misses.empty() ? none : median_of(std::move(misses));
}

}  // namespace

std::vector<TableMisreading> misread_units(std::span<const TargetObservation> observations,
                                           std::span<const RigHead> heads, double together_s, bool fits) {
  constexpr std::size_t max_heads = 4, enough = 160, most = 12;
  std::vector<TableMisreading> all;
  const double above = fits ? 1.0 : 0.0;
  add_units(heads, std::nullopt, above, all);
  for (std::size_t head = 0; head < std::min(heads.size(), max_heads); ++head) add_units(heads, head, above, all);
  std::vector<std::pair<double, TableMisreading>> by_miss;
  const auto first = observations.first(std::min(observations.size(), enough));
  for (TableMisreading& each : all) by_miss.emplace_back(median_miss(first, heads, together_s, each), std::move(each));
  std::ranges::stable_sort(by_miss, {}, [](const auto& each) { return each.first; });
  std::vector<TableMisreading> nearest;
  for (std::size_t k = 0; k < std::min(by_miss.size(), most) && std::isfinite(by_miss[k].first); ++k)
    nearest.push_back(std::move(by_miss[k].second));
  return nearest;
}

}  // namespace alidade
