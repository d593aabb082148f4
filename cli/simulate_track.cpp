#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/io/events_file.h"
#include "alidade/io/rig_file.h"
#include "alidade/simulate/track.h"
#include "cli/commands.h"
#include "cli/frame.h"
#include "cli/option_checks.h"

namespace alidade::cli {
namespace {

struct Args {
  std::string scenario = "B";
  double latency_ms = -1.0, lag_s = 0.34, sigma_px = 0.5, sigma_angle = 0.0008726646259971648;
};

TrackScene scene_of(const Args& args) {
  auto scene = track_scenario(args.scenario);
  if (!scene)
    throw UsageError(
        fmt::format("--scenario: '{}' is not one of {}", args.scenario, fmt::join(track_scenarios(), ", ")));
  if (args.latency_ms >= 0.0) scene->latency_s = 1e-3 * args.latency_ms;
  scene->aiming_lag_s = args.lag_s;
  scene->sigma_px = args.sigma_px;
  scene->sigma_encoder_rad = args.sigma_angle;
  for (RigHead& head : scene->heads) head.head.encoder.sigma_rad = args.sigma_angle;
  return *scene;
}

TrueTrack truth_of(const TrackScene& scene) {
  TrueTrack truth;
  constexpr double rate_hz = 200.0;
  const double until_s = scene.duration_s + 1.0;  // so that predictions can be judged as well
  for (int k = 0; k <= static_cast<int>(until_s * rate_hz); ++k) {
    truth.t_s.push_back(k / rate_hz);
    truth.position.push_back(scene.position(k / rate_hz));
  }
  return truth;
}

ExitCode simulate_track_events(const Args& args, Run& run) {
  const TrackScene scene = scene_of(args);
  std::vector<TargetSight> sights;
  for (const SimulatedSight& s : simulate_track(scene, run.options.seed))
    sights.push_back({s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, s.px});
  run.add_file("events.csv", events_csv(sights, scene.heads));
  run.add_file("truth.csv", true_track_csv(truth_of(scene)));
  Rig rig;
  rig.heads = scene.heads;
  run.add_file("rig.yaml", rig_text(rig));
  run.document.estimate["sigma_a_m_s2"] = scene.sigma_a_m_s2;
  run.document.estimate["duration_s"] = scene.duration_s;
  run.document.counts.given = run.document.counts.used = sights.size();
  Verdict verdict;
  verdict.sentence = fmt::format("scenario {}: {} sights of two heads with known truth", scene.name, sights.size());
  run.say(fmt::format("{} in {}", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

}  // namespace

void add_track_scenario(Frame& frame) {
  auto args = std::make_shared<Args>();
  CLI::App& command = frame.add_command(
      {"simulate track", "What two pan-tilt heads see of a moving target, and its true path",
       "  alidade simulate track --scenario C --out sim && alidade track sim/events.csv --rig sim/rig.yaml \\\n"
       "    --truth sim/truth.csv\n"
       "  alidade simulate track --scenario B --latency-ms 100 --out late",
       true},
      [args](Run& run) { return simulate_track_events(*args, run); });
  command.add_option("--scenario", args->scenario, fmt::format("{}", fmt::join(track_scenarios(), ", ")))
      ->capture_default_str();
  const auto number = [&](const char* name, double& value, const char* help, double low, double high) {
    return command.add_option(name, value, help)->check(finite_number() & CLI::Range(low, high));
  };
  number("--latency-ms", args->latency_ms, "Capture to arrival (default: the scenario's)", 0.0, 10000.0);
  number("--lag-s", args->lag_s, "Time constant of the heads", 0.0, 10.0)->capture_default_str();
  number("--sigma-px", args->sigma_px, "Noise of the target's pixel", 0.0, 100.0)->capture_default_str();
  number("--sigma-angle", args->sigma_angle, "Noise of an encoder [rad]", 0.0, 1.0)->capture_default_str();
}

}  // namespace alidade::cli
