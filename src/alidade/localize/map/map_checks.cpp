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

/// Few moved points do no harm once their old positions are dropped. If a part that moved as one is nearly as large as
/// the one that stayed, it is undecidable which of them moved.
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

/// The path is then between the poses by the two parts, off by more than its σ.
void add_moved_part(const MovedPart& part, Verdict& verdict) {
  constexpr double chance = 28.0;  // χ² of three, over some hundred parts: 99.9 %
  const std::string all = std::to_string(part.num_given);
  if (part.chi2 > chance)
    verdict.checks.push_back({"target's points", State::care,
                              std::to_string(part.num) + " of the target's " + all +
                                  " points that are seen lie elsewhere than given against the others, by " +
                                  distance_text(part.shift_m) + " (" + text_of(std::sqrt(part.chi2), 2) +
                                  "σ): the path is between what both say",
                              part.chi2, chance, "1", "path"});
  else if (part.spread > part.spread_limit)
    verdict.checks.push_back({"target's points", State::care,
                              "the target's " + all + " points are " + text_of(std::sqrt(part.spread), 2) +
                                  "σ off along one direction: some of them are not where they are given, and the "
                                  "path is between what all say",
                              part.spread, part.spread_limit, "1", "path"});
  else
    return;
  verdict.to_add = "measure the target's points again";
}

}  // namespace

void add_map(const Localization& report, Verdict& verdict) {
  add_moved(report.moved_points, verdict);
  add_moved_part(report.moved_part, verdict);
  if (report.lacks_map_frame)
    verdict.checks.push_back({"map's file", State::care,
                              "the map's file does not say how well its frame is known: σ is against the map, and not "
                              "the world",
                              0.0, 0.0, "", "path"});
}

}  // namespace alidade
