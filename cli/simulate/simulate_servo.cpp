#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <memory>
#include <numbers>

#include "alidade/simulate/servo.h"
#include "alidade/tables/servo_log_file.h"
#include "alidade/tables/servo_scenario_file.h"
#include "cli/app/app.h"
#include "cli/app/option_checks.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

constexpr double no_limit_deg_s = 1e6;

struct SimulateServoArgs {
  std::string kind = "angle", unit = "deg";
  bool chirp = false, one_step = false;
  int commands_per_row = 1;
  double gain = 0.0, tau_s = 0.1, latency_s = 0.08, max_rate_deg_s = no_limit_deg_s, max_acceleration_deg_s2 = 1e9;
  double dead_band = 0.0, backlash_deg = 0.0, second_tau_s = 0.0, max_command = 0.0, rate_offset_deg_s = 0.0;
  double soft_max_rate_deg_s = 0.0;
  Mode resonance{.hz = 0.0, .damping = 0.05, .share = 1.0};
  double amplitude = 200.0, duration_s = 5.0, rate_hz = 100.0, sigma_deg = 0.05, step_deg = 0.0, zero_deg = 0.0;
};

ServoLogScene scene_of(const SimulateServoArgs& args) {
  const double deg = std::numbers::pi / 180.0;
  ServoLogScene scene;
  if (args.kind == "rate") {
    RatePlant plant{args.gain != 0.0 ? args.gain : 0.3, *unit_named(args.unit), args.tau_s};
    plant.max_rate_rad_s = deg * args.max_rate_deg_s;
    plant.max_acceleration_rad_s2 = deg * args.max_acceleration_deg_s2;
    scene.axis.plant = plant;
  } else {
    AnglePlant plant{args.gain != 0.0 ? args.gain : 0.0567, *unit_named(args.unit), args.tau_s};
    if (args.max_rate_deg_s < no_limit_deg_s) plant.max_rate_rad_s = deg * args.max_rate_deg_s;
    scene.axis.plant = plant;
  }
  scene.axis.dead_band = args.dead_band;
  scene.axis.backlash_rad = deg * args.backlash_deg;
  scene.axis.second_tau_s = args.second_tau_s;
  scene.mode = args.resonance;
  scene.max_command = args.max_command;
  scene.rate_offset_rad_s = deg * args.rate_offset_deg_s;
  scene.soft_max_rate_rad_s = deg * args.soft_max_rate_deg_s;
  scene.axis.command_delay_s = args.latency_s;
  scene.is_chirp = args.chirp;
  if (args.one_step) scene.steps = {1.0};
  scene.amplitude = args.amplitude;
  scene.duration_s = args.duration_s;
  scene.rate_hz = args.rate_hz;
  scene.commands_per_row = args.commands_per_row;
  scene.zero_rad = deg * args.zero_deg;
  scene.sigma_rad = deg * args.sigma_deg;
  scene.encoder_step_rad = deg * args.step_deg;
  return scene;
}

ExitCode simulate_servo(const SimulateServoArgs& args, Run& run) {
  if (args.duration_s * args.rate_hz * args.commands_per_row > 1e6)
    throw UsageError("--rate-hz: makes more than a million rows");
  const ServoLogScene scene = scene_of(args);
  std::vector<ServoSample> samples;
  for (const ServoLogRow& row : simulate_servo_log(scene, run.options.seed))
    samples.push_back({row.t_s, row.command, row.angle_rad});
  run.add_file("log.csv", servo_log_csv(samples));
  run.add_file("scenario.yaml", servo_scenario_text());
  run.document.estimate["gain_rad"] = gain_of(scene.axis.plant);
  run.document.estimate["tau_s"] = args.tau_s;
  run.document.estimate["latency_s"] = args.latency_s;
  run.document.counts.given = run.document.counts.used = samples.size();
  Verdict verdict;
  verdict.sentence = fmt::format("{} rows of a servo under a {} with known truth", samples.size(),
                                 args.chirp      ? "chirp"
                                 : args.one_step ? "step"
                                                 : "row of steps");
  run.say(fmt::format("{} in {}, with a scenario of alidade servo", verdict.sentence, run.options.out.string()));
  return run.finish(verdict);
}

}  // namespace

void add_servo_scenario(App& app) {
  auto args = std::make_shared<SimulateServoArgs>();
  CLI::App& command = app.add_command(
      {"simulate servo", "Log of one servo axis driven by steps or a chirp, for `identify`, and a scenario for `servo`",
       "  alidade simulate servo --out sim && alidade identify sim/log.csv && alidade servo sim/scenario.yaml\n"
       "  alidade simulate servo --chirp --kind rate --latency-s 0.05 --out rate",
       true},
      [args](Run& run) { return simulate_servo(*args, run); });
  command.add_option("--kind", args->kind, "Quantity that follows the command with a lag: the angle or its rate")
      ->check(CLI::IsMember({"angle", "rate"}))
      ->capture_default_str();
  command.add_flag("--chirp", args->chirp, "Command a chirp from 0.1 to 3 Hz instead of steps");
  command.add_flag("--one-step", args->one_step,
                   "Command a single step at 0.5 s instead of several in both directions");
  command
      .add_option("--gain", args->gain, "Angle (or rate) per unit of command (default: 0.0567; with --kind rate 0.3)")
      ->check(finite_number());
  command.add_option("--unit", args->unit, "Unit of the angle in the gain")
      ->check(CLI::IsMember({"deg", "rad"}))
      ->capture_default_str();
  add_number(command, "--tau-s", args->tau_s, "Time constant [s]", 1e-4, 100.0);
  add_number(command, "--latency-s", args->latency_s, "Latency from a command to its first effect [s]", 0.0, 10.0);
  add_number(command, "--max-rate-deg-s", args->max_rate_deg_s, "Maximum rate [deg/s]", 1e-3, no_limit_deg_s);
  add_number(command, "--max-acceleration-deg-s2", args->max_acceleration_deg_s2,
             "With --kind rate: maximum acceleration [deg/s2]", 1e-3, 1e9);
  add_number(command, "--dead-band", args->dead_band,
             "Dead band: smaller commands do nothing, larger ones are reduced by it [units of command]", 0.0, 1e9);
  add_number(command, "--max-command", args->max_command, "Saturation of the command [units of command]; 0: none", 0.0,
             1e9);
  add_number(command, "--rate-offset-deg-s", args->rate_offset_deg_s,
             "Rate in addition to the commanded rate, for example from a misadjusted neutral [deg/s]", -90.0, 90.0);
  add_number(command, "--soft-max-rate-deg-s", args->soft_max_rate_deg_s,
             "Soft rate limit: a rate r becomes r / (1 + r / limit), as of a motor whose torque falls with speed; 0: "
             "none [deg/s]",
             0.0, 1e6);
  add_number(command, "--backlash-deg", args->backlash_deg,
             "Backlash between the drive and the angle that is read [deg]", 0.0, 90.0);
  add_number(command, "--second-tau-s", args->second_tau_s, "Time constant of a second lag, on the command [s]", 0.0,
             100.0);
  add_number(command, "--resonance-hz", args->resonance.hz,
             "Natural frequency of a resonance behind the drive [Hz]; 0: none", 0.0, 1000.0);
  add_number(command, "--resonance-damping", args->resonance.damping, "Damping ratio of the resonance", 1e-3, 0.9);
  add_number(command, "--resonance-share", args->resonance.share,
             "Share of the motion that passes through the resonance; the rest is rigid", -10.0, 10.0);
  add_number(command, "--amplitude", args->amplitude, "Amplitude of the steps or chirp, in units of command", 0.0, 1e9);
  add_number(command, "--duration-s", args->duration_s, "Duration of the log [s]", 1e-3, 1e4);
  add_number(command, "--rate-hz", args->rate_hz, "Rows per second", 1e-2, 1e5);
  command
      .add_option("--commands-per-row", args->commands_per_row,
                  "Commands per row, as of a controller faster than its log (with --chirp)")
      ->check(CLI::Range(1, 100))
      ->capture_default_str();
  add_number(command, "--sigma-deg", args->sigma_deg, "σ of the encoder [deg]", 0.0, 90.0);
  add_number(command, "--step-deg", args->step_deg, "Resolution of the encoder [deg]; 0: no rounding", 0.0, 90.0);
  add_number(command, "--zero-deg", args->zero_deg, "Encoder reading at angle zero [deg]", -360.0, 360.0);
}

}  // namespace alidade::cli
