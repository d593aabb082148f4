#include <fmt/format.h>

#include <array>
#include <cmath>
#include <cstdlib>
#include <functional>
#include <vector>

#include "alidade/simulate/draws.h"
#include "alidade/simulate/turned_scene.h"
#include "alidade/turned/turned.h"

// Photos of a camera turned by hand: is the focal length right, and does σ mean what it says? Other cameras, turns and
// points each draw. Prints Markdown; exits 1 where a goal is missed.

namespace {

using namespace alidade;

struct Scenario {
  const char* name;
  bool is_on_the_spot;  ///< And said so.
  std::function<void(TurnedScene&)> change;
};

/// A camera of 35 to 75° across, 5 to 14 photos, overlaps of a half to three quarters.
TurnedScene any_scene(std::uint64_t seed) {
  Draws draws(seed);
  TurnedScene scene;
  scene.fx = scene.fy = draws.uniform(850.0, 2000.0);
  scene.cx = 639.5 + 12.0 * draws.normal();
  scene.cy = 479.5 + 12.0 * draws.normal();
  scene.k1 = 0.1 * draws.uniform(-1.0, 1.0) * std::pow(scene.fx / 1000.0, 2);
  scene.num_photos = 5 + static_cast<int>(10.0 * draws.uniform());
  scene.pan_step_rad = draws.uniform(0.25, 0.5) * scene.width_px / scene.fx;
  scene.tilt_rad = draws.uniform(0.0, 0.3) * scene.height_px / scene.fx;
  scene.points_per_rad2 = 250.0 * std::pow(scene.fx / 1000.0, 2);
  scene.sigma_px = draws.uniform(0.2, 1.0);
  return scene;
}

struct Tally {
  int draws = 0, stands = 0, false_good = 0;
  std::array<int, 3> inside{}, centre{};
  double squares = 0.0, sigma = 0.0;
};

void add(const TurnedScene& scene, const MatchedPhotos& photos, const TurnedConfig& config, Tally& tally) {
  const TurnedReport report = observe_turned(photos, config);
  ++tally.draws;
  if (report.status != TurnedReport::Status::ok) return;
  ++tally.stands;
  const Eigen::VectorXd sigma = report.cov.diagonal().cwiseSqrt();
  const double error = std::abs(report.camera[0] - scene.fx), off = std::abs(report.camera[2] - scene.cx);
  for (int k = 0; k < 3; ++k) {
    tally.inside[static_cast<std::size_t>(k)] += error < (k + 1.0) * sigma[0] ? 1 : 0;
    tally.centre[static_cast<std::size_t>(k)] += off < (k + 1.0) * sigma[2] ? 1 : 0;
  }
  tally.squares += std::pow(error / scene.fx, 2);
  tally.sigma += sigma[0] / scene.fx;
  const bool is_good = turned_verdict(report, photos, config).state == State::good;
  tally.false_good += is_good && error > 5.0 * sigma[0] ? 1 : 0;
}

}  // namespace

int main(int argc, char** argv) {
  const int num_draws = argc > 1 ? std::atoi(argv[1]) : 200;
  const std::vector<Scenario> scenarios{
      {"clean", true, [](TurnedScene&) {}},
      {"0.5 % wrong matches", true, [](TurnedScene& scene) { scene.wrong_share = 0.005; }},
      {"30 % wrong matches", true, [](TurnedScene& scene) { scene.wrong_share = 0.3; }},
      {"a quarter of the points moves", true, [](TurnedScene& scene) { scene.moving_share = 0.25; }},
      {"lever of 5 mm, points at 2 to 20 m", false, [](TurnedScene& scene) { scene.lever_m.z() = 0.005; }},
      {"lever of 5 cm", false, [](TurnedScene& scene) { scene.lever_m.z() = 0.05; }},
      {"lever of 20 cm", false, [](TurnedScene& scene) { scene.lever_m.z() = 0.2; }},
      {"the hand steps by 1 cm", false, [](TurnedScene& scene) { scene.sigma_step_m = 0.01; }},
      {"focus walks by 0.3 %", false, [](TurnedScene& scene) {
         for (int k = 0; k < scene.num_photos; ++k) scene.zoom.push_back(1.0 + 0.003 * std::sin(2.0 * k));
       }}};
  fmt::print(
      "# Photos of a camera turned by hand\n\n{} draws each, `make study`: f 850 to 2000 px, 5 to 14 photos of 1280 × "
      "960, k1, centre, noise (0.2 to 1 px) and turns drawn anew. ",
      num_draws);
  fmt::print("Said to be on the spot (`--sigma-parallax 0`): the first four.\n\n");
  fmt::print("| | stands | error of f, RMS | σ, mean | f inside 1, 2, 3σ | cx inside 1, 2, 3σ | ● beyond 5σ |\n");
  fmt::print("|---|---|---|---|---|---|---|\n");
  bool met = true;
  for (const Scenario& scenario : scenarios) {
    Tally tally;
    for (int i = 0; i < num_draws; ++i) {
      const auto seed = static_cast<std::uint64_t>(1000 + i);
      TurnedScene scene = any_scene(seed);
      scenario.change(scene);
      TurnedConfig config;
      if (scenario.is_on_the_spot) config.sigma_parallax = 0.0;
      add(scene, simulate_turned_photos(scene, seed), config, tally);
    }
    const double n = std::max(tally.stands, 1);
    const auto share = [n](const std::array<int, 3>& inside) {
      return fmt::format("{:.0f}, {:.0f}, {:.0f} %", 100.0 * inside[0] / n, 100.0 * inside[1] / n,
                         100.0 * inside[2] / n);
    };
    fmt::print("| {} | {} of {} | {:.3f} % | {:.3f} % | {} | {} | {} |\n", scenario.name, tally.stands, tally.draws,
               100.0 * std::sqrt(tally.squares / n), 100.0 * tally.sigma / n, share(tally.inside), share(tally.centre),
               tally.false_good);
    std::fflush(stdout);
    met = met && tally.false_good == 0 && tally.inside[2] >= 0.97 * n;
    met = met && (!scenario.is_on_the_spot || tally.inside[1] >= 0.93 * n);
  }
  return met ? 0 : 1;
}
