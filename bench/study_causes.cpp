#include <fmt/format.h>

#include <cstdlib>
#include <functional>
#include <vector>

#include "alidade/geometry/degree.h"
#include "alidade/testing/rangefinder_trial.h"
#include "alidade/testing/rig_trial.h"

// How large must what is wrong with a rig or a rangefinder be to be seen, and is an answer that stands ever far off
// below that? Prints Markdown; exits 1 where a good verdict stands over an error above 5σ.

namespace {

using namespace alidade;
using namespace alidade::testing;

struct Found {
  double seen = 0.0, good = 0.0, worst = 0.0;  ///< Shares; largest error, in σ, below a good verdict.
  int silent = 0;
};

template <typename Setup>
struct Case {
  const char* name;
  const char* unit;
  std::vector<double> sizes;
  std::function<void(Setup&, double)> set;
};
using RigCase = Case<RigTrialSetup>;
using ShotCase = Case<RangefinderTrialSetup>;

RigTrial trial_of(const RigTrialSetup& setup, std::uint64_t seed) { return rig_trial(setup, seed); }
RangefinderTrial trial_of(const RangefinderTrialSetup& setup, std::uint64_t seed) {
  return rangefinder_trial(setup, seed);
}
const Verdict& verdict_of(const RigTrial& trial) { return trial.verdict; }
const Verdict& verdict_of(const RangefinderTrial& trial) { return trial.solved.verdict; }

template <typename Setup>
Found found_of(const Case<Setup>& one, double size, int draws) {
  Found found;
  for (int draw = 1; draw <= draws; ++draw) {
    Setup setup;
    one.set(setup, size);
    const auto trial = trial_of(setup, static_cast<std::uint64_t>(7000 + draw));
    found.seen += trial.is_seen ? 1.0 / draws : 0.0;
    const bool is_good = verdict_of(trial).state == State::good;
    found.good += is_good ? 1.0 / draws : 0.0;
    if (is_good) found.worst = std::max(found.worst, trial.worst_sigmas);
    found.silent += trial.is_silent() ? 1 : 0;
    if (std::getenv("ALIDADE_WORDS") != nullptr)
      fmt::print(stderr, "{} {} {}: {:.1f} {} | {}\n", one.name, size, draw, trial.worst_sigmas,
                 verdict_of(trial).sentence, verdict_of(trial).to_add);
  }
  return found;
}

/// "0.5 %", "0.002"; "–" of what has no size.
template <typename Setup>
std::string size_text(const Case<Setup>& one, double size) {
  if (one.sizes.size() == 1 && *one.unit == '\0') return "–";
  return *one.unit == '\0' ? fmt::format("{:g}", size) : fmt::format("{:g} {}", size, one.unit);
}

/// One table; returns how many good verdicts stood over an error above 5σ.
template <typename Setup>
int table_of(const std::vector<Case<Setup>>& cases, int draws, const std::string& only) {
  fmt::print("| fault | size | detected | ● | worst error at ● | undetected, beyond 5σ |\n|---|---|---|---|---|---|\n");
  int silent = 0;
  std::string power;
  for (const Case<Setup>& one : cases) {
    if (!only.empty() && only != one.name) continue;
    double seen_from = -1.0;
    for (const double size : one.sizes) {
      const Found found = found_of(one, size, draws);
      silent += found.silent;
      if (found.seen < 0.99) seen_from = -1.0;
      if (found.seen >= 0.99 && seen_from < 0.0) seen_from = size;
      fmt::print("| {} | {} | {:.0f} % | {:.0f} % | {:.1f}σ | {} |\n", one.name, size_text(one, size),
                 100.0 * found.seen, 100.0 * found.good, found.worst, found.silent);
      std::fflush(stdout);
    }
    if (size_text(one, seen_from) != "–" && seen_from >= 0.0)
      power += fmt::format("{}{} {}", power.empty() ? "" : ", ", one.name, size_text(one, seen_from));
  }
  if (!power.empty()) fmt::print("\nDetected in 99 % of the draws or more from: {}.\n", power);
  return silent;
}

}  // namespace

int main(int argc, char** argv) {
  const int draws = argc > 1 ? std::atoi(argv[1]) : 100;
  const std::string only = argc > 2 ? argv[2] : "";
  const std::vector<RigCase> cases{
      {"clean", "", {0.0}, [](RigTrialSetup&, double) {}},
      {"clean, scale not given", "", {0.0}, [](RigTrialSetup& s, double) { s.gives_scale = false; }},
      {"encoder scale, not given",
       "%",
       {1.0},
       [](RigTrialSetup& s, double v) {
         s.scene.encoder_scale = 1.0 + 0.01 * v;
         s.gives_scale = false;
       }},
      {"encoder scale, σ 0.02 % given",
       "%",
       {0.1, 0.2, 0.5, 1.0},
       [](RigTrialSetup& s, double v) { s.scene.encoder_scale = 1.0 + 0.01 * v, s.sigma_scale = 2e-4; }},
      {"encoder scale",
       "%",
       {0.05, 0.1, 0.2, 0.5, 1.0, 2.0, 5.0},
       [](RigTrialSetup& s, double v) { s.scene.encoder_scale = 1.0 + 0.01 * v; }},
      {"one period a turn",
       "°",
       {0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0},
       [](RigTrialSetup& s, double v) { s.scene.once_rad = v * degree; }},
      {"two periods a turn",
       "°",
       {0.05, 0.1, 0.2, 0.5, 1.0, 2.0},
       [](RigTrialSetup& s, double v) { s.noise.twice_rad = v * degree; }},
      {"backlash",
       "°",
       {0.02, 0.05, 0.1, 0.2, 0.5, 1.0},
       [](RigTrialSetup& s, double v) { s.noise.backlash_rad = v * degree; }},
      {"focal length",
       "%",
       {0.1, 0.2, 0.5, 1.0, 2.0, 5.0},
       [](RigTrialSetup& s, double v) { s.mistake.focal = 0.01 * v; }},
      {"focal length of one lens, σ 0.3 px given",
       "%",
       {0.1, 0.2, 0.5, 1.0},
       [](RigTrialSetup& s, double v) { s.mistake.focal = 0.01 * v, s.sigma_lens_px = 0.3, s.first_lens_only = true; }},
      {"centre", "px", {0.5, 1.0, 2.0, 5.0, 10.0, 20.0}, [](RigTrialSetup& s, double v) { s.mistake.centre_px = v; }},
      {"angles swapped", "", {1.0}, [](RigTrialSetup& s, double) { s.mistake.swap_angles = true; }},
      {"pan flipped", "", {1.0}, [](RigTrialSetup& s, double) { s.mistake.flip_pan = true; }},
      {"mirrored", "", {1.0}, [](RigTrialSetup& s, double) { s.mistake.mirror = true; }},
      {"heads swapped, lenses differ",
       "",
       {1.0},
       [](RigTrialSetup& s, double) {
         for (const RigHead& head : xiahou_rig()) s.scene.nominal.push_back(head);
         s.scene.nominal[1].camera = mistaken_camera(s.scene.nominal[1].camera, {.focal = 0.15});
         s.mistake.swap_heads = true;
       }},
      {"rows shifted", "", {1.0}, [](RigTrialSetup& s, double) { s.mistake.shift_rows = true; }},
  };
  const std::vector<ShotCase> shot_cases{
      {"shots as given", "", {0.0}, [](RangefinderTrialSetup&, double) {}},
      {"range scale",
       "%",
       {0.05, 0.1, 0.2, 0.5, 1.0, 2.0},
       [](RangefinderTrialSetup& s, double v) { s.scale = 1.0 + 0.01 * v; }},
      {"square", "%", {0.05, 0.1, 0.2, 0.5, 1.0, 2.0}, [](RangefinderTrialSetup& s, double v) { s.square = 0.01 * v; }},
      {"range offset", "mm", {10.0, 100.0}, [](RangefinderTrialSetup& s, double v) { s.mistake.offset_m = 0.001 * v; }},
      {"spot σ at 1 m",
       "px",
       {0.5, 1.0, 2.0, 5.0},
       [](RangefinderTrialSetup& s, double v) { s.noise.sigma_spot_near_px = v; }},
      {"focal length of the file",
       "%",
       {0.2, 0.5, 1.0, 2.0, 5.0},
       [](RangefinderTrialSetup& s, double v) { s.mistake.focal = 0.01 * v; }},
      {"centre of the file",
       "px",
       {2.0, 5.0, 10.0, 20.0, 50.0},
       [](RangefinderTrialSetup& s, double v) { s.mistake.centre_px = v; }},
      {"k1 of the file",
       "",
       {0.002, 0.005, 0.01, 0.02, 0.05, 0.1},
       [](RangefinderTrialSetup& s, double v) { s.mistake.k1 = v; }},
      {"p1 of the file",
       "",
       {0.0005, 0.001, 0.002, 0.005},
       [](RangefinderTrialSetup& s, double v) { s.mistake.p1 = v; }},
      {"readings depend on incidence, at 45°",
       "mm",
       {3.0, 8.0, 20.0, 40.0},
       [](RangefinderTrialSetup& s, double v) { s.noise.incidence_m = 1e-3 * v; }},
      {"sheet before the print",
       "mm",
       {1.0, 3.0, 6.0, 12.0, 30.0},
       [](RangefinderTrialSetup& s, double v) { s.noise.sheet_m = 1e-3 * v; }},
      {"board bowed", "mm", {0.2, 0.5, 1.5}, [](RangefinderTrialSetup& s, double v) { s.noise.bow_m = 1e-3 * v; }},
      {"readings drift, lengths exact",
       "mm",
       {2.0, 5.0, 10.0, 20.0, 50.0},
       [](RangefinderTrialSetup& s, double v) { s.mistake.drift_m = 1e-3 * v, s.gives_lengths = true; }},
      {"readings bend by 1 m from 2 m, lengths exact",
       "mm",
       {1.0, 2.0, 5.0, 10.0},
       [](RangefinderTrialSetup& s, double v) { s.mistake.bend_m = 1e-3 * v, s.gives_lengths = true; }},
      {"spots wander", "px", {0.5, 1.0, 2.0, 5.0}, [](RangefinderTrialSetup& s, double v) { s.mistake.wander_px = v; }},
      {"u and v exchanged, spots alone",
       "",
       {1.0},
       [](RangefinderTrialSetup& s, double) {
         s.mistake.exchange_uv = true, s.method = RangefinderMethod::spot, s.has_boards = false;
       }},
      {"wrong readings",
       "%",
       {6.0, 17.0, 33.0, 45.0, 56.0},
       [](RangefinderTrialSetup& s, double v) { s.noise.outlier_share = 0.01 * v; }},
      {"rows late", "", {1.0}, [](RangefinderTrialSetup& s, double) { s.mistake.shift_rows = 1; }},
      {"rows early", "", {1.0}, [](RangefinderTrialSetup& s, double) { s.mistake.shift_rows = -1; }},
      {"inches", "", {1.0}, [](RangefinderTrialSetup& s, double) { s.mistake.unit_m = 0.0254; }},
      {"feet", "", {1.0}, [](RangefinderTrialSetup& s, double) { s.mistake.unit_m = 0.3048; }},
      {"centimetres", "", {1.0}, [](RangefinderTrialSetup& s, double) { s.mistake.unit_m = 0.01; }},
  };
  fmt::print(
      "# Faults of rigs and rangefinders, and which are detected\n\n`study_causes {}` (`make study` draws "
      "100): "
      "one fault at a time, {} draws per row. Detected: refused, ◆, or estimated. The last columns: the largest "
      "error of a draw that is ●, in its stated σ, and how many draws were ● and off by more than 5σ.\n\n"
      "## `alidade rig`\n\nTwo heads, 320×240, f 338 px, corners 0.2 px, readings 0.02°, five placements of a board, "
      "four views per head and placement; lenses, square and (unless stated) the encoders' scales given as exact.\n\n",
      draws, draws);
  int silent = table_of(cases, draws, only);
  fmt::print(
      "\n## `alidade rangefinder`\n\n18 shots from 0.5 to 4 m with board and spot, corners 0.2 px, spots 0.3 px, "
      "readings 2 mm, a lens known to 1.5, 1.5, 2, 2 px; no σ given.\n\n");
  silent += table_of(shot_cases, draws, only);
  return silent == 0 ? 0 : 1;
}
