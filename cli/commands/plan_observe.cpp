#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/observe.h"
#include "alidade/results/moves_outcome.h"
#include "alidade/results/observation_result.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanObserveArgs {
  std::filesystem::path result;
  MoveConfig config;
};

ExitCode plan_observe(const PlanObserveArgs& args, Run& run) {
  const bool is_folder = std::filesystem::is_directory(args.result);
  run.add_input("result", is_folder ? args.result / "result.json" : args.result);
  return run.finish(outcome_of(plan_moves(read_observation(args.result), args.config, run.progress)));
}

}  // namespace

void add_plan_observe(App& app) {
  auto args = std::make_shared<PlanObserveArgs>();
  CLI::App& command =
      app.add_command({.name = "plan observe",
                       .summary = "Rotations of the head that reduce the uncertainty most",
                       .examples = "alidade plan observe alidade-out/observe --moves 3 --rate-deg-s 15\n",
                       .writes_at_end = true},
                      [args](Run& run) { return plan_observe(*args, run); });
  command.add_option("result", args->result, "Result folder or result.json of observe")->required();
  app.add_fields(command, fields_of(args->config));
}

}  // namespace alidade::cli
