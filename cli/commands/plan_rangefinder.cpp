#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/results/rangefinder_result.h"
#include "alidade/results/shots_outcome.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanRangefinderArgs {
  std::filesystem::path result;
  ShotConfig config;
};

ExitCode plan_rangefinder(const PlanRangefinderArgs& args, Run& run) {
  const bool is_folder = std::filesystem::is_directory(args.result);
  run.add_input("result", is_folder ? args.result / "result.json" : args.result);
  return run.finish(outcome_of(plan_shots(read_rangefinder(args.result), args.config, run.progress)));
}

}  // namespace

void add_plan_rangefinder(App& app) {
  auto args = std::make_shared<PlanRangefinderArgs>();
  CLI::App& command =
      app.add_command({.name = "plan rangefinder",
                       .summary = "Where to hold the board for the shots that reduce the uncertainty most",
                       .examples = "alidade plan rangefinder alidade-out/rangefinder --shots 3\n",
                       .writes_at_end = true},
                      [args](Run& run) { return plan_rangefinder(*args, run); });
  command.add_option("result", args->result, "Result folder or result.json of rangefinder")->required();
  app.add_fields(command, fields_of(args->config));
}

}  // namespace alidade::cli
