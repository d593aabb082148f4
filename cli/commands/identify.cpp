#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <memory>
#include <numbers>

#include "alidade/results/identify_document.h"
#include "alidade/tables/servo_log_file.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct IdentifyArgs {
  std::filesystem::path log;
  bool skip_bad = false;
};

void summarize(const ServoIdentification& identified, Run& run) {
  const ServoFit& fit = identified.fit;
  const ServoParams sigma = fit.cov.diagonal().cwiseSqrt();
  const bool is_angle = fit.kind == ServoKind::angle;
  const double deg = 180.0 / std::numbers::pi;
  const std::string per = is_angle ? "" : "/s";
  run.say(fmt::format("{} plant   (3σ)", is_angle ? "angle" : "rate"));
  run.say(fmt::format("gain      {:.6g} ± {:.2g} rad{} per unit = {:.6g} ± {:.2g} deg{}", fit.params[0], 3.0 * sigma[0],
                      per, fit.params[0] * deg, 3.0 * sigma[0] * deg, per));
  run.say(fmt::format("tau       {:.6g} ± {:.2g} s", fit.params[1], 3.0 * sigma[1]));
  run.say(fmt::format("latency   {:.6g} ± {:.2g} s", fit.params[2], 3.0 * sigma[2]));
  for (const std::size_t flaw : fit.freed)
    run.say(fmt::format("{} {:.6g} ± {:.2g} {}", servo_flaw_words[flaw], fit.flaws.*servo_flaws[flaw],
                        3.0 * fit.flaw_sigma[flaw], servo_flaw_units[flaw]));
  run.say(fmt::format("residuals {:.3g}° RMS, correlation {:.2f}; as {} plant {:.3g}°", fit.rms_rad * deg,
                      identified.lag_one_correlation, is_angle ? "a rate" : "an angle",
                      identified.other.rms_rad * deg));
}

ExitCode identify(const IdentifyArgs& args, Run& run) {
  run.add_input("log", args.log);
  const ServoLogFile log = read_servo_log(args.log, args.skip_bad);
  run.lap("read");
  ServoIdentification identified;
  if (log.samples.size() >= 20) identified = identify_servo(log.samples);
  run.lap("fit");
  const Verdict verdict = identify_verdict(log.samples, identified);
  run.document.counts.given = log.skipped.size();
  run.document.counts.skipped = log.skipped;
  fill_identification(log.samples, identified, run.document);
  if (has_estimate(verdict)) {
    summarize(identified, run);
    run.add_file("servo.yaml", servo_plant_text(identified.fit));
  }
  return run.finish(verdict);
}

}  // namespace

void add_identify(App& app) {
  auto args = std::make_shared<IdentifyArgs>();
  CLI::App& command = app.add_command(
      {.name = "identify",
       .summary =
           "Gain, time constant, latency, limits, dead band and backlash of one axis of a pan-tilt head from a log of "
           "commands and angles",
       .examples = "  alidade identify log.csv\n"
                   "  alidade simulate servo --chirp --out sim && alidade identify sim/log.csv\n"},
      [args](Run& run) { return identify(*args, run); });
  command
      .add_option("log", args->log,
                  "CSV: t_s,command,angle_rad (or angle_deg): the command from that time on, the angle read at it")
      ->required();
  command.add_flag("--skip-bad", args->skip_bad, "Leave out rows that are wrong, by name, instead of stopping");
}

}  // namespace alidade::cli
