#include "cli/commands/commands.h"

#include <algorithm>
#include <array>
#include <string_view>

#include "cli/app/app.h"

namespace alidade::cli {
namespace {

struct NamedCommand {
  std::string_view name;
  void (*add)(App& app);
};

constexpr std::array commands{NamedCommand{"batch", add_batch},         NamedCommand{"calibrate", add_calibrate},
                              NamedCommand{"camera", add_camera},       NamedCommand{"corners", add_corners},
                              NamedCommand{"fleet", add_fleet},         NamedCommand{"head", add_head},
                              NamedCommand{"identify", add_identify},   NamedCommand{"localize", add_localize},
                              NamedCommand{"observe", add_observe},     NamedCommand{"plan", add_plan},
                              NamedCommand{"project", add_project},     NamedCommand{"rangefinder", add_rangefinder},
                              NamedCommand{"reproduce", add_reproduce}, NamedCommand{"rig", add_rig},
                              NamedCommand{"schema", add_schema},       NamedCommand{"servo", add_servo},
                              NamedCommand{"simulate", add_simulate},   NamedCommand{"study", add_study},
                              NamedCommand{"track", add_track},         NamedCommand{"view", add_view}};

}  // namespace

void add_commands(App& app) {
  // A command's options cost more than reading the line: those of the others are not made.
  if (app.first_word() == "--version") return;
  const auto asked = std::ranges::find(commands, app.first_word(), &NamedCommand::name);
  if (asked != commands.end()) return asked->add(app);
  for (const NamedCommand& command : commands) command.add(app);
}

}  // namespace alidade::cli
