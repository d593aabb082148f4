#include <fmt/format.h>

#include <Eigen/Cholesky>
#include <array>
#include <cstdlib>

#include "alidade/testing/rangefinder_sample.h"

// How far off is the beam of a rangefinder, for each method with and without the refinement of everything, against the
// number of shots; is the default at its bound, and what does its σ cover? Prints Markdown; exits 1 where a goal is
// missed.

namespace {

using namespace alidade;
using namespace alidade::testing;

constexpr std::array<int, 9> counts{3, 5, 6, 8, 10, 14, 18, 24, 30};

void add_row(int num_shots, RangefinderMethod method, Refine refine, int trials) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  scene.num_shots = num_shots;
  std::vector<double> position_mm, direction_mrad, px;
  int refused = 0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto sample = draw_rangefinder_sample(scene, {}, static_cast<std::uint64_t>(100000 * num_shots + trial));
    RangefinderConfig config = told_config(method);
    config.refine = refine;
    const RangefinderReport report = solve_sample(sample, config);
    refused += rangefinder_verdict(report, sample.simulated.shots, config).exit_code != ExitCode::ok;
    position_mm.push_back(1e3 * origin_error_m(report, sample));
    direction_mrad.push_back(1e3 * direction_error_rad(report, sample).norm());
    px.push_back(reprojection_px(report, sample));
  }
  const char* const names[] = {"spot", "plane", "joint"};
  fmt::print("| {} | {} | {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.2g} | {:.0f} |\n", num_shots,
             names[static_cast<int>(method)], refine == Refine::all ? "all" : "beam", quantile_of(position_mm, 0.5),
             quantile_of(position_mm, 0.9), quantile_of(direction_mrad, 0.5), quantile_of(px, 0.5),
             quantile_of(px, 0.9), 100.0 * refused / trials);
}

/// Spots alone, few of them: the error of the origin beside what the bound allows, whose covariance at the true beam is
/// drawn from once a log. Where the two are alike, no estimator would have been nearer.
void study_few_spots(int num_shots, int trials) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference"), exact = scene;
  scene.num_shots = exact.num_shots = num_shots;
  exact.beam.noise = {1e-9};
  std::vector<double> position_mm, bound_mm;
  for (int trial = 0; trial < trials; ++trial) {
    const auto seed = static_cast<std::uint64_t>(4000000 + 100000 * num_shots + trial);
    const RangefinderConfig config = told_config(RangefinderMethod::spot);
    const auto sample = draw_rangefinder_sample(scene, {}, seed);
    position_mm.push_back(1e3 * origin_error_m(solve_sample(sample, config), sample));
    auto without_noise = draw_rangefinder_sample(exact, {.sigma_spot_px = 1e-9}, seed);
    without_noise.camera = exact.camera;
    const Eigen::Matrix3d cov = solve_sample(without_noise, config).bound.cov.topLeftCorner<3, 3>();
    Draws draws(seed + 3000003);
    const Eigen::Vector3d z = draws.normal3().reverse();
    bound_mm.push_back(1e3 * (Eigen::Matrix3d(cov.llt().matrixL()) * z).norm());
  }
  fmt::print("| {} | {:.2g} | {:.2g} | {:.2g} | {:.2g} |\n", num_shots, quantile_of(position_mm, 0.5),
             quantile_of(bound_mm, 0.5), quantile_of(position_mm, 0.9), quantile_of(bound_mm, 0.9));
}

/// RMS of the error over the bound, of origin and direction, and the share inside 1σ and 2σ.
bool study_bound(RangefinderMethod method, int trials) {
  RangefinderSceneConfig scene = *rangefinder_scenario("reference");
  double squares = 0.0, inside1 = 0.0, inside2 = 0.0;
  for (int trial = 0; trial < trials; ++trial) {
    const auto sample = draw_rangefinder_sample(scene, {}, static_cast<std::uint64_t>(9000000 + trial));
    const RangefinderReport report = solve_sample(sample, told_config(method));
    Eigen::Vector<double, 5> error;
    error << report.beam.origin_in_cam - sample.scene.beam.origin_in_cam, direction_error_rad(report, sample);
    for (Eigen::Index i = 0; i < 5; ++i) {
      squares += error[i] * error[i] / report.bound.cov(i, i) / 5.0;
      const double z = std::abs(error[i]) / std::sqrt(report.beam.cov(i, i));
      inside1 += z < 1.0 ? 0.2 : 0.0;
      inside2 += z < 2.0 ? 0.2 : 0.0;
    }
  }
  const double ratio = std::sqrt(squares / trials), share1 = 100.0 * inside1 / trials,
               share2 = 100.0 * inside2 / trials;
  const char* const names[] = {"spot", "plane", "joint"};
  fmt::print("| {} | {:.3f} | {:.1f} | {:.1f} |\n", names[static_cast<int>(method)], ratio, share1, share2);
  return ratio <= 1.10 && std::abs(share1 - 68.3) <= 4.0 && std::abs(share2 - 95.4) <= 2.0;
}

}  // namespace

int main(int argc, char** argv) {
  const int trials = argc > 1 ? std::atoi(argv[1]) : 200, many = argc > 2 ? std::atoi(argv[2]) : 2000;
  fmt::print("# A laser rangefinder: error against the number of shots, the bound, and what σ covers\n\n");
  fmt::print(
      "`study_rangefinder {} {}` (`make study`): board 9×6 of 40 mm, corners 0.2 px, spot 0.3 px, readings 2 mm, "
      "0.5–4 m, tilts 0–45°, lens known to 1.5, 1.5, 2, 2 px. {} logs a row; `all` refines lens, boards and beam "
      "together, `beam` holds lens and boards. px: RMS of the predicted spot from 0.5 to 4 m.\n\n",
      trials, many, trials);
  fmt::print(
      "| shots | method | refine | position mm | p90 | direction mrad | spot px | p90 | refused % |\n"
      "|---|---|---|---|---|---|---|---|---|\n");
  for (const int count : counts)
    for (const RangefinderMethod method : {RangefinderMethod::spot, RangefinderMethod::plane, RangefinderMethod::joint})
      for (const Refine refine : {Refine::beam, Refine::all})
        if (method != RangefinderMethod::plane || count >= 5) add_row(count, method, refine, trials);
  fmt::print(
      "\nSpots alone, {} logs a row; `bound`: drawn from the Cramér–Rao bound of the same shots.\n\n"
      "| shots | position mm | bound | p90 | bound |\n|---|---|---|---|---|\n",
      many);
  for (const int count : {3, 5, 6, 8, 10}) study_few_spots(count, many);
  fmt::print(
      "\n18 shots, {} logs:\n\n| method | RMS error over the bound | inside 1σ [%] | inside 2σ [%] |\n"
      "|---|---|---|---|\n",
      many);
  const bool met = study_bound(RangefinderMethod::joint, many);
  study_bound(RangefinderMethod::spot, many);
  study_bound(RangefinderMethod::plane, many);
  fmt::print("\nGoals of `joint` (ratio ≤ 1.10, 68 ± 4 %, 95 ± 2 %): {}.\n", met ? "met" : "missed");
  return met ? 0 : 1;
}
