#include <fmt/format.h>

#include <chrono>
#include <limits>
#include <thread>

#include "alidade/results/fleet_text.h"
#include "cli/fleet/worker.h"

namespace alidade::fleet {
namespace {

using Clock = std::chrono::steady_clock;

Publication observation_of(const FleetScene& scene, const cli::FleetSimulation& simulation, std::int64_t n) {
  Publication publication;
  publication.subject = "cam." + scene.id + ".obs";
  publication.payload =
      fleet_row_text(fleet_row_of(simulate_observation(scene, simulation.scene, simulation.seed, n), n));
  publication.headers["Nats-Msg-Id"] = fmt::format("{}-{}", scene.id, n);
  return publication;
}

}  // namespace

ExitCode run_publisher(const cli::FleetSimulation& simulation, cli::Run& run) {
  Broker broker(broker_options(simulation.broker));
  while (!broker.make_streams()) std::this_thread::sleep_for(std::chrono::milliseconds(100));
  std::vector<FleetScene> scenes;
  for (int i = 0; i < simulation.cameras; ++i) scenes.push_back(draw_fleet_scene(simulation.scene, simulation.seed, i));
  const auto begin = Clock::now();
  std::size_t stored = 0;
  double latest_s = 0.0;
  for (int n = 1; n <= simulation.rows; ++n) {
    report_progress(run.progress, "rows", static_cast<std::size_t>(n), static_cast<std::size_t>(simulation.rows));
    if (simulation.is_real_time) {
      const auto due = begin + std::chrono::duration_cast<Clock::duration>(
                                   std::chrono::duration<double>((n - 1) / simulation.scene.rate_hz));
      std::this_thread::sleep_until(due);
    }
    std::vector<Publication> rows;
    for (const FleetScene& scene : scenes) rows.push_back(observation_of(scene, simulation, n));
    // Again until it is stored: the broker knows a message by its Nats-Msg-Id.
    while (!broker.store(rows, 10000)) report_progress(run.progress, "rows", static_cast<std::size_t>(n), 0);
    stored += rows.size();
    const double late_s = std::chrono::duration<double>(Clock::now() - begin).count() - n / simulation.scene.rate_hz;
    if (simulation.is_real_time) latest_s = std::max(latest_s, late_s);
  }
  const double seconds = std::chrono::duration<double>(Clock::now() - begin).count();
  Verdict verdict;
  verdict.sentence = fmt::format("{} rows of {} cameras published in {:.1f} s, {:.0f} a second", stored,
                                 simulation.cameras, seconds, static_cast<double>(stored) / seconds);
  run.document.estimate["rows"] = stored;
  run.document.estimate["rows_per_s"] = static_cast<double>(stored) / seconds;
  run.document.estimate["latest_s"] = latest_s;
  run.document.counts.given = run.document.counts.used = stored;
  run.say(verdict.sentence);
  return run.finish(verdict);
}

}  // namespace alidade::fleet
