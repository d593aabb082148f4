#include "alidade/identify.h"

#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/results/identify_outcome.h"
#include "alidade/tables/servo_log_file.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct IdentifyArgs {
  std::filesystem::path log;
  bool skip_bad = false;
  IdentifyConfig config;
};

FieldList fields_of(IdentifyArgs& args) {
  FieldList fields = alidade::fields_of(args.config);
  fields.push_back(
      {.name = "skip_bad", .value = &args.skip_bad, .help = "Skip invalid rows, naming each, instead of stopping"});
  return fields;
}

ExitCode run_identify(const IdentifyArgs& args, Run& run) {
  run.add_input("log", args.log);
  ServoLogFile log = read_servo_log(args.log, args.skip_bad);
  run.lap("read");
  const Identification result = alidade::identify(std::move(log.samples), args.config);
  run.lap("fit");
  JobOutcome outcome = outcome_of(result);
  add_skipped(log.skipped, outcome);
  return run.finish(std::move(outcome));
}

}  // namespace

void add_identify(App& app) {
  auto args = std::make_shared<IdentifyArgs>();
  CLI::App& command =
      app.add_command({.name = "identify",
                       .summary = "Gain, time constant, latency, limits, dead band and backlash of one pan-tilt axis, "
                                  "from a log of commands and angles",
                       .examples = "  alidade identify log.csv\n"
                                   "  alidade simulate servo --chirp --out sim && alidade identify sim/log.csv\n",
                       .writes_at_end = true},
                      [args](Run& run) { return run_identify(*args, run); });
  command
      .add_option("log", args->log,
                  "CSV: t_s,command,angle_rad (or angle_deg): the angle read at t_s, and the command in force from t_s "
                  "on (from command_t_s, if that column exists)")
      ->required();
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
