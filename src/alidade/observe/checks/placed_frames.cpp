#include <algorithm>
#include <cmath>
#include <cstddef>
#include <string>

#include "alidade/observe/checks/frame_places.h"
#include "alidade/observe/rotation_frame.h"
#include "alidade/observe/setup.h"

namespace alidade {
namespace {

/// Rate at which images become ever later (rows per row), if it is steady; otherwise 0.
double steady_lateness(const FramePlaces& places) {
  constexpr int fewest = 3;
  constexpr double most_rows = 2.0;
  if (places.later.empty() || places.later.back() < fewest || places.missing.size() < 2 || !places.repeated.empty())
    return 0.0;
  const double rate = places.later.back() / static_cast<double>(places.later.size());
  for (std::size_t k = 0; k < places.later.size(); ++k)
    if (std::abs(places.later[k] - rate * static_cast<double>(k)) > most_rows) return 0.0;
  return rate;
}

}  // namespace

RotationLog placed(const RotationLog& log, const FramePlaces& places) {
  RotationLog moved = log;
  for (RotationRow& row : moved.rows) std::ranges::fill(row.px, Eigen::Vector2d::Constant(not_seen));
  for (std::size_t k = 0; k < log.rows.size(); ++k) {
    const auto to = static_cast<std::ptrdiff_t>(k) + (places.later.empty() ? 0 : places.later[k]);
    const bool has_row = to >= 0 && to < static_cast<std::ptrdiff_t>(log.rows.size());
    if (has_row && !std::ranges::binary_search(places.repeated, k))
      moved.rows[static_cast<std::size_t>(to)].px = log.rows[k].px;
  }
  return moved;
}

Check places_check(const RotationLog& log, const FramePlaces& places) {
  constexpr std::size_t most_named = 3;
  std::string text;
  int num = 0;
  for (const FramePlaces::Gap& gap : places.missing) num += gap.num;
  if (num > 0) {
    text = std::to_string(num) + (num == 1 ? " frame is" : " frames are") + " missing:";
    for (std::size_t i = 0; i < std::min(most_named, places.missing.size()); ++i)
      text += (i == 0 ? " before " : ", ") + row_time_text(log.rows[places.missing[i].before].t_s) + " (" +
              std::to_string(places.missing[i].num) + ")";
    text += places.missing.size() > most_named ? " …" : "";
    text += "; the images behind are taken with the rotation of so many rows later: number them as they were taken";
    if (const double rate = steady_lateness(places); rate > 0.0)
      text += "; at such a steady rate it may be the images' clock, slower than the rotation's by " +
              text_of(100.0 * rate, 2) + " %: give both by one clock";
  }
  if (!places.repeated.empty())
    text += (text.empty() ? "" : "; ") + std::to_string(places.repeated.size()) +
            (places.repeated.size() == 1 ? " image is" : " images are") +
            " the one before once more while the camera rotates, first at " +
            row_time_text(log.rows[places.repeated.front()].t_s) + ": rejected";
  if (places.num_inserted > 0)
    text += "; behind " + std::to_string(places.num_inserted) +
            " of them the images are taken with the rotation of a row earlier each: number them as they were taken";
  return {frames_check, State::care, text,       static_cast<double>(num) + static_cast<double>(places.repeated.size()),
          0.0,          "1",         "residuals"};
}

}  // namespace alidade
