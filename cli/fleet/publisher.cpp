#include <fmt/format.h>

#include <algorithm>
#include <chrono>
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

/// Rows are published in the order of their numbers, each until it is stored.
class Publisher {
 public:
  Publisher(const cli::FleetSimulation& simulation, cli::Run& run)
      : simulation_(simulation), run_(run), broker_(broker_options(simulation.broker)) {
    for (int i = 0; i < simulation.cameras; ++i)
      scenes_.push_back(draw_fleet_scene(simulation.scene, simulation.seed, i));
  }

  /// Throws Interrupted.
  void publish() {
    while (!broker_.make_streams()) wait_until(Clock::now() + std::chrono::milliseconds(100));
    begin_ = Clock::now();
    for (int n = 1; n <= simulation_.rows; ++n) {
      at_ = static_cast<std::size_t>(n);
      check();
      if (simulation_.is_real_time) wait_until(begin_ + in_s((n - 1) / simulation_.scene.rate_hz));
      publish_row(n);
      const double late_s = seconds() - n / simulation_.scene.rate_hz;
      if (simulation_.is_real_time) latest_s_ = std::max(latest_s_, late_s);
    }
  }

  [[nodiscard]] std::size_t num_stored() const { return num_stored_; }
  [[nodiscard]] double latest_s() const { return latest_s_; }
  [[nodiscard]] double seconds() const { return std::chrono::duration<double>(Clock::now() - begin_).count(); }

 private:
  static Clock::duration in_s(double s) {
    return std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(s));
  }
  void check() const { report_progress(run_.progress, "rows", at_, static_cast<std::size_t>(simulation_.rows)); }

  void wait_until(Clock::time_point until) const {
    for (; Clock::now() < until; check())
      std::this_thread::sleep_until(std::min(until, Clock::now() + std::chrono::milliseconds(100)));
  }

  /// Again until it is stored: the broker knows a message by its Nats-Msg-Id.
  void publish_row(std::int64_t n) {
    std::vector<Publication> rows;
    for (const FleetScene& scene : scenes_) rows.push_back(observation_of(scene, simulation_, n));
    const auto goes_on = [this] { return !run_.progress || run_.progress("rows", at_, 0); };
    while (!broker_.store(rows, 10000, goes_on)) {
      if (goes_on()) continue;
      num_stored_ += static_cast<std::size_t>(std::ranges::count_if(rows, &Publication::is_stored));
      throw Interrupted();
    }
    num_stored_ += rows.size();
  }

  const cli::FleetSimulation& simulation_;
  cli::Run& run_;
  Broker broker_;
  std::vector<FleetScene> scenes_;
  Clock::time_point begin_ = Clock::now();
  std::size_t at_ = 0, num_stored_ = 0;
  double latest_s_ = 0.0;
};

}  // namespace

ExitCode run_publisher(const cli::FleetSimulation& simulation, cli::Run& run) {
  Publisher publisher(simulation, run);
  try {
    publisher.publish();
  } catch (const Interrupted&) {
    throw Interrupted(fmt::format("interrupted; {} rows of {} cameras are published; no files are written",
                                  publisher.num_stored(), simulation.cameras));
  }
  const double seconds = publisher.seconds();
  const std::size_t stored = publisher.num_stored();
  Verdict verdict;
  verdict.sentence = fmt::format("{} rows of {} cameras published in {:.1f} s, {:.0f} a second", stored,
                                 simulation.cameras, seconds, static_cast<double>(stored) / seconds);
  run.document.estimate["rows"] = stored;
  run.document.estimate["rows_per_s"] = static_cast<double>(stored) / seconds;
  run.document.estimate["latest_s"] = publisher.latest_s();
  run.document.counts.given = run.document.counts.used = stored;
  run.say(verdict.sentence);
  return run.finish(verdict);
}

}  // namespace alidade::fleet
