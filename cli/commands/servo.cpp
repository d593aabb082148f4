#include "alidade/servo.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "alidade/live/streams.h"
#include "alidade/results/servo_outcome.h"
#include "alidade/tables/servo_scenario_file.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/option_checks.h"
#include "cli/app/pace.h"
#include "cli/commands/camera_values.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct ServoArgs {
  std::filesystem::path scenario;
  std::vector<std::string> controllers;
  int seeds = 0;
  double latency_ms = -1.0, gain_factor = 0.0, tau_factor = 0.0;
  std::string intrinsics;
  bool no_robustness = false, real_time = false;
  LiveOptions live;
};

/// The command line overrides the file.
ServoScenario with_options(ServoScenario scenario, const ServoArgs& args) {
  if (!args.controllers.empty()) {
    scenario.controllers.clear();
    for (const std::string& name : args.controllers) scenario.controllers.push_back(*controller_named(name));
  }
  if (args.seeds > 0) scenario.num_seeds = args.seeds;
  if (args.latency_ms >= 0.0) scenario.scene.latency_s = 1e-3 * args.latency_ms;
  if (args.gain_factor > 0.0) scenario.scene.mismatch.gain = args.gain_factor;
  if (args.tau_factor > 0.0) scenario.scene.mismatch.tau = args.tau_factor;
  if (!args.intrinsics.empty()) scenario.scene.intrinsics = *lens_knowledge_named(args.intrinsics);
  if (args.no_robustness) scenario.robustness.reset();
  return scenario;
}

/// What a run by the wall clock reports about its steps.
void tell_pace(const Pace& pace, JobOutcome& outcome) {
  JsonValue& given = outcome.document.estimate["realtime"];
  given["steps"] = pace.num_steps();
  given["steps_late"] = pace.num_late();
  given["worst_late_s"] = pace.worst_late_s();
  outcome.lines.push_back(fmt::format("in real time: {} steps, {} more than 1 ms late, the worst by {:.2g} ms",
                                      pace.num_steps(), pace.num_late(), 1e3 * std::max(0.0, pace.worst_late_s())));
}

ServoResult studied(const ServoScenario& scenario, live::ServoStream& stream, LiveRun& live, Pace& pace, Run& run) {
  if (live.is_on()) live.open(stream.topics(), "/servo");
  if (live.server() != nullptr) stream.begin(*live.server());
  const ServoWatch watch = [&](ControllerKind controller, const ServoRow& row) {
    live.keep_pace(row.t_s);
    pace.keep(row.t_s);
    if (live.server() != nullptr) stream.show(*live.server(), controller, row);
  };
  ServoResult result = alidade::servo(scenario, run.options.seed, live.progress(), watch);
  if (live.server() != nullptr && !result.comparison.empty())
    stream.show(*live.server(), result.comparison.back().controller, result.comparison.back().shown.rows.back(), true);
  return result;
}

ExitCode run_servo_command(const ServoArgs& args, Run& run) {
  run.add_input("scenario", args.scenario);
  const ServoScenarioFile read = read_servo_scenario(args.scenario);
  if (!read.rig.empty()) add_rig_input(run, read.rig);
  for (const std::string& doubt : read.rig_doubts) run.add_doubt(doubt, rig_doubts_remedy);
  if (!read.track.empty()) run.add_input("track", read.track);
  const ServoScenario scenario = with_options(read.scenario, args);
  run.lap("read");
  live::ServoStream stream(scenario.scene);
  LiveRun live(args.live, run);
  Pace pace(args.real_time ? 1.0 : 0.0);
  JobOutcome outcome = outcome_of(studied(scenario, stream, live, pace, run));
  run.lap("run");
  if (args.real_time) tell_pace(pace, outcome);
  return live.finish(std::move(outcome));
}

}  // namespace

void add_servo(App& app) {
  auto args = std::make_shared<ServoArgs>();
  CLI::App& command = app.add_command(
      {.name = "servo",
       .summary =
           "Simulate closed-loop tracking of a moving target by two pan-tilt heads; compare controllers by pixel error",
       .examples = "  alidade servo scenario.yaml\n"
                   "  alidade servo scenario.yaml --controller mpc --latency-ms 100 --seeds 20\n\n"
                   "scenario.yaml; every key is optional, with these defaults:\n\n" +
                   servo_scenario_text(),
       .draws_random_numbers = true,
       .writes_at_end = true},
      [args](Run& run) { return run_servo_command(*args, run); });
  command.add_option("scenario", args->scenario, "YAML: target, heads, plant, delays, noise, controllers; see below")
      ->required();
  command.add_option("--controller", args->controllers, "Run only these controllers: pi, feedforward, lqr, mpc")
      ->check(CLI::IsMember({"pi", "feedforward", "lqr", "mpc"}))
      ->delimiter(',');
  command.add_option("--seeds", args->seeds, "Runs per controller, with seeds from --seed on")
      ->check(CLI::Range(1, 1000));
  command.add_option("--latency-ms", args->latency_ms, "Delay from capture of an image to its pixel")
      ->check(number_within(0.0, 10000.0));
  command.add_option("--true-gain", args->gain_factor, "True gain of the plant / gain known to the controllers")
      ->check(number_within(0.01, 100.0));
  command
      .add_option("--true-tau", args->tau_factor, "True time constant of the plant / the one known to the controllers")
      ->check(number_within(0.01, 100.0));
  command
      .add_option("--intrinsics", args->intrinsics,
                  "Intrinsics used by the loop when lenses zoom: given (the rig's), observed (estimated online from "
                  "static points in the images), true")
      ->check(CLI::IsMember({"given", "observed", "true"}));
  command.add_flag("--no-robustness", args->no_robustness, "Skip the robustness grid over gain and time constant");
  command.add_flag("--realtime", args->real_time,
                   "Run the first run of each controller in real time and report how late its steps were (default: as "
                   "fast as possible)");
  add_live_options(command, args->live);
}

}  // namespace alidade::cli
