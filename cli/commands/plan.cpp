#include <CLI/CLI.hpp>
#include <memory>

#include "alidade/results/calibration_result.h"
#include "alidade/results/photos_outcome.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

struct PlanArgs {
  std::filesystem::path result;
  PhotoConfig config;
};

ExitCode plan_calibrate(const PlanArgs& args, Run& run) {
  const CalibratedNow now = read_calibration(args.result);
  const std::filesystem::path folder =
      std::filesystem::is_directory(args.result) ? args.result : args.result.parent_path();
  run.add_input("result", folder / "result.json");
  run.add_input("camera", folder / "camera.yaml");
  return run.finish(outcome_of(plan_photos(now, args.config, run.progress)));
}

}  // namespace

void add_plan(App& app) {
  app.add_group("plan", "Plan the next measurements");
  auto args = std::make_shared<PlanArgs>();
  CLI::App& command = app.add_command({.name = "plan calibrate",
                                       .summary = "Board poses whose photos reduce the uncertainty most",
                                       .examples = "alidade plan calibrate alidade-out/calibrate --photos 3\n",
                                       .writes_at_end = true},
                                      [args](Run& run) { return plan_calibrate(*args, run); });
  command.add_option("result", args->result, "Result folder or result.json of calibrate")->required();
  app.add_fields(command, fields_of(args->config));
  add_plan_observe(app);
  add_plan_rangefinder(app);
}

}  // namespace alidade::cli
