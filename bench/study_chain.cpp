#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdlib>

#include "alidade/testing/chain_sample.h"

// Does σ hold at the end of a chain? Photos of a board give lenses, views of boards through these lenses give a rig,
// and with that rig a target is followed. Prints Markdown; exits 1 where the goal is missed.

namespace {

using namespace alidade;
using namespace alidade::testing;

struct Row {
  double counted = 0.0, squares = 0.0, exact = 0.0, inside1 = 0.0, inside2 = 0.0, rms_m = 0.0;
  int num = 0;
};

/// NEES over the track, and whether its last position is covered.
void add(const Chain& chain, double range_m, std::uint64_t seed, Row& row) {
  const TrackReport counted = track_chain(chain, range_m, seed, true), exact = track_chain(chain, range_m, seed, false);
  if (!std::isfinite(counted.nees_per_dof) || !std::isfinite(exact.nees_per_dof)) return;
  row.counted += counted.nees_per_dof;
  row.squares += counted.nees_per_dof * counted.nees_per_dof;
  row.exact += exact.nees_per_dof;
  row.rms_m += counted.rms_m * counted.rms_m;
  const double nees = counted.nees.back();  // χ² with 3 degrees of freedom has 1σ and 2σ at 3.53 and 8.02
  row.inside1 += nees < 3.53 ? 1.0 : 0.0;
  row.inside2 += nees < 8.02 ? 1.0 : 0.0;
  ++row.num;
}

}  // namespace

int main(int argc, char** argv) {
  const int chains = argc > 1 ? std::atoi(argv[1]) : 200;
  constexpr std::array<double, 4> ranges_m{1.0, 3.0, 6.0, 12.0};
  std::array<Row, ranges_m.size()> rows;
  int failed = 0;
  for (int k = 0; k < chains; ++k) {
    const auto seed = static_cast<std::uint64_t>(k) + 1;
    const auto chain = draw_chain(seed);
    failed += chain ? 0 : 1;
    if (!chain) continue;
    for (std::size_t i = 0; i < rows.size(); ++i) add(*chain, ranges_m[i], 7000 + seed, rows[i]);
  }
  fmt::print("# σ at the end of a chain\n\n");
  fmt::print(
      "`study_chain {}` (`make study`): 13 photos of a 9×6 board a camera (640×480, 0.1 px), then 5 places of the "
      "board "
      "seen by both heads (0.2 px, encoders 0.02°, their scales estimated), then a target for 3 s (0.3 px, 0.02°), "
      "heads "
      "0.5 m apart. NEES: of the position, over the track, per degree of freedom; 1 where σ is what it says. "
      "Inside 1σ and 2σ: the last position, by its whole covariance. `exact`: rig and lenses taken as exact. {} chains "
      "without an answer.\n\n",
      chains, failed);
  fmt::print(
      "| range m | chains | RMS error mm | NEES/3 | ± | inside 1σ % | 2σ % | NEES/3 exact |\n"
      "|---|---|---|---|---|---|---|---|\n");
  bool met = failed * 20 <= chains;
  for (std::size_t i = 0; i < rows.size(); ++i) {
    const Row& row = rows[i];
    const double mean = row.counted / row.num;
    const double sigma = std::sqrt(std::max(0.0, row.squares / row.num - mean * mean) / row.num);
    fmt::print("| {} | {} | {:.1f} | {:.2f} | {:.2f} | {:.0f} | {:.0f} | {:.1f} |\n", ranges_m[i], row.num,
               1e3 * std::sqrt(row.rms_m / row.num), mean, sigma, 100.0 * row.inside1 / row.num,
               100.0 * row.inside2 / row.num, row.exact / row.num);
    met = met && mean >= 0.7 && mean <= 1.3;
  }
  fmt::print("\nGoal (NEES/3 from 0.7 to 1.3 at every range): {}.\n", met ? "met" : "missed");
  return met ? 0 : 1;
}
