#include "alidade/reference/schema.h"

#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <memory>

#include "cli/app/app.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

ExitCode print_schema(const std::vector<std::string>& words, Run& run) {
  const std::string command = fmt::format("{}", fmt::join(words, " "));
  const std::vector<std::string> known = commands_with_results();
  if (std::ranges::find(known, command) == known.end()) {
    throw UsageError(fmt::format("'{}' leaves no result; there is {}", command, fmt::join(known, ", ")));
  }
  run.add_file("schema.json", result_schema(command).text(2) + "\n");
  run.print_file("schema.json");
  return run.finish(Verdict{.state = State::good, .sentence = "the schema of " + command});
}

}  // namespace

void add_schema(App& app) {
  auto words = std::make_shared<std::vector<std::string>>();
  CLI::App& command =
      app.add_command({.name = "schema",
                       .summary = "JSON schema of the result.json that a command writes",
                       .examples = "alidade schema calibrate\nalidade schema plan observe > plan-observe.schema.json\n",
                       .leaves_results = false},
                      [words](Run& run) { return print_schema(*words, run); });
  command.add_option("command", *words, "Command name, for example: plan observe")->required();
}

}  // namespace alidade::cli
