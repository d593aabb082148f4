#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/geometry/degree.h"
#include "alidade/heads/head_identify.h"
#include "alidade/results/head_outcome.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct HeadArgs {
  std::string url;
  bool identify = false, move = false;
  HeadRange range;
};

/// "LOW,HIGH" in degrees.
TextCode range_code(HeadRange& range, int axis) {
  return numbers_code(
      2,
      [&range, axis]() -> std::vector<double> {
        if (range.low_rad[axis] < -1e8) return {};
        return {range.low_rad[axis] / degree, range.high_rad[axis] / degree};
      },
      [&range, axis](const std::vector<double>& numbers) {
        range.low_rad[axis] = numbers[0] * degree;
        range.high_rad[axis] = numbers[1] * degree;
      });
}

FieldList fields_of(HeadArgs& args) {
  return {{.name = "move", .value = &args.move, .help = "The head may move; without it nothing does"},
          {.name = "identify",
           .value = &args.identify,
           .help = "Its model: rate, acceleration, time constant, latency, backlash, dead band, repeatability"},
          {.name = "pan_range",
           .value = range_code(args.range, 0),
           .help = "Where it may go, in degrees, left above zero (default: the head's own limits)",
           .form = "LOW,HIGH"},
          {.name = "tilt_range",
           .value = range_code(args.range, 1),
           .help = "Where it may go, in degrees, up above zero (default: the head's own limits)",
           .form = "LOW,HIGH"}};
}

void check_head(const HeadArgs& args) {
  if (args.identify && !args.move) throw UsageError("--identify moves the head: give --move as well");
  if (!(args.range.low_rad.array() <= args.range.high_rad.array()).all())
    throw UsageError("--pan-range and --tilt-range are LOW,HIGH with LOW not above HIGH");
}

ExitCode run_head(const HeadArgs& args, Run& run) {
  check_head(args);
  const std::unique_ptr<HeadDevice> device = open_head(args.url);
  run.lap("connect");
  JobOutcome outcome = args.identify ? outcome_of(identify_head(*device, args.range, run.progress))
                                     : outcome_of(survey_head(*device, args.move, args.range, run.progress));
  run.lap(args.identify ? "identify" : "ask");
  return run.finish(std::move(outcome));
}

}  // namespace

void add_head(App& app) {
  auto args = std::make_shared<HeadArgs>();
  CLI::App& command = app.add_command(
      {.name = "head",
       .summary = "A pan-tilt head that is connected: what it is, and how it follows its commands",
       .examples = "alidade head rotctl://127.0.0.1:4533\n"
                   "alidade head rotctl://127.0.0.1:4533 --identify --move --pan-range -60,60 --tilt-range 0,60\n"
                   "alidade head 'sim://?seed=3' --identify --move\n"},
      [args](Run& run) { return run_head(*args, run); });
  command.add_option("url", args->url, "rotctl://HOST:PORT (Hamlib's rotctld), or sim://?seed=N, a simulated one")
      ->required();
  app.add_fields(command, fields_of(*args));
}

}  // namespace alidade::cli
