#include <cmath>
#include <string>

#include "alidade/localize/checks/judge.h"
#include "alidade/localize/path/path_doubt.h"

namespace alidade {
namespace {

std::string distance_text(double distance_m) {
  constexpr double long_m = 0.1;
  return distance_m < long_m ? text_of(1000.0 * distance_m, 2) + " mm" : text_of(distance_m, 2) + " m";
}

/// Few do no harm without their old positions. Where a part that moved as one is nearly as large as the one that
/// stayed, nothing says which of both did.
void add_moved(const MovedPoints& moved, Verdict& verdict) {
  if (moved.num == 0) return;
  constexpr double few = 0.1;
  const std::size_t num_still = moved.num_judged - moved.num;
  const bool is_either = 3 * moved.num_as_one >= 2 * num_still;
  const double part = share(moved.num, moved.num_judged);
  std::string text = std::to_string(moved.num) + " of the map's " + std::to_string(moved.num_judged) +
                     " points that are seen have moved since it was made";
  if (moved.median_m > 0.0) text += ", by " + distance_text(moved.median_m) + " (their median)";
  text += moved.is_left_out ? ": they are new points, and the path is by the others"
                            : ": a recording of so many frames is not solved again without them";
  if (is_either)
    text +=
        "; as " + std::to_string(moved.num_as_one) + " of them moved as one, which of both parts stayed is not known";
  verdict.checks.push_back({"map's points",
                            is_either || (part > few && !moved.is_left_out) ? State::bad
                            : part > few                                    ? State::care
                                                                            : State::good,
                            std::move(text), part, few, "1", "path"});
  if (part > few || is_either) verdict.to_add = "make the map again";
}

}  // namespace

void add_map(const Localization& report, Verdict& verdict) {
  add_moved(report.moved_points, verdict);
  if (report.lacks_map_frame)
    verdict.checks.push_back({"map's file", State::care,
                              "the map's file does not say how well its frame is known: σ is against the map, and not "
                              "the world",
                              0.0, 0.0, "", "path"});
}

}  // namespace alidade
