#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <string>
#include <utility>
#include <vector>

#include "alidade/track/checks/explanation.h"

namespace alidade {
namespace {

/// Pixels of a few consecutive rows of a head, none equal to the one before: single
/// rows of two heads that keep a target centred to whole pixels agree by chance.
using PixelRun = std::array<double, 8>;

/// Start time of each run of a head.
std::multimap<PixelRun, double> pixel_runs(std::span<const TargetObservation> sorted, std::size_t head) {
  std::multimap<PixelRun, double> runs;
  std::vector<const TargetObservation*> last;
  for (const TargetObservation& observation : sorted) {
    if (observation.head != head) continue;
    if (!last.empty() && last.back()->px == observation.px) last.clear();
    last.push_back(&observation);
    PixelRun run{};
    if (2 * last.size() < run.size()) continue;
    if (2 * last.size() > run.size()) last.erase(last.begin());
    for (std::size_t k = 0; k < last.size(); ++k) run[2 * k] = last[k]->px.x(), run[2 * k + 1] = last[k]->px.y();
    runs.emplace(run, last.front()->t_capture_s);
  }
  return runs;
}

}  // namespace

std::optional<Explanation> copied_pixels(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads) {
  constexpr double max_apart_s = 1.0, min_share = 0.5;
  constexpr std::size_t least = 8;
  std::vector<TargetObservation> sorted(observations.begin(), observations.end());
  std::ranges::stable_sort(sorted, {}, &TargetObservation::t_capture_s);
  std::vector<std::multimap<PixelRun, double>> runs;
  for (std::size_t head = 0; head < heads.size(); ++head) runs.push_back(pixel_runs(sorted, head));
  for (std::size_t b = 1; b < heads.size(); ++b) {
    for (std::size_t a = 0; a < b; ++a) {
      const auto is_copied = [&](const std::pair<const PixelRun, double>& run) {
        const auto [first, last] = runs[a].equal_range(run.first);
        return std::any_of(first, last,
                           [&](const auto& of_a) { return std::abs(of_a.second - run.second) < max_apart_s; });
      };
      const auto num = static_cast<std::size_t>(std::ranges::count_if(runs[b], is_copied));
      if (num < least || static_cast<double>(num) < min_share * static_cast<double>(runs[b].size())) continue;
      const std::string of_b = std::to_string(heads[b].head.id), of_a = std::to_string(heads[a].head.id);
      return Explanation{"the pixels of head " + of_b + " are those of head " + of_a + ", digit for digit",
                         "give what the camera of each head saw: one table was given for both"};
    }
  }
  return std::nullopt;
}

}  // namespace alidade
