#include "cli/commands/commands.h"

#include "alidade/results/result_folder.h"
#include "cli/app/app.h"
#include "python/bindings/bindings.h"
#include "python/bindings/waiting.h"

/// The jobs of rooms that have no public face yet: what the command does, by the command's own words. A room that gets
/// its face leaves this file.
namespace alidade::python {
namespace {

py::list described_commands() {
  cli::App app;
  cli::add_commands(app);
  py::list all;
  for (const cli::CommandInfo& command : app.commands()) {
    py::list options;
    for (const cli::OptionInfo& option : command.options) {
      py::dict one;
      one["name"] = option.name;
      one["option"] = option.option;
      one["help"] = option.help;
      one["form"] = option.form;
      one["standard"] = option.standard;
      one["group"] = option.group;
      one["is_required"] = option.is_required;
      one["is_list"] = option.is_list;
      options.append(one);
    }
    py::dict one;
    one["name"] = command.name;
    one["summary"] = command.summary;
    one["options"] = options;
    all.append(one);
  }
  return all;
}

OutcomePtr run_command(const std::vector<std::string>& words, const py::object& progress) {
  return value_of<OutcomePtr>(
      [words](const Progress& report) {
        cli::App app;
        if (!words.empty()) app.set_first_word(words.front());
        cli::add_commands(app);
        return std::make_shared<Outcome>(Outcome{app.run_job(words, report), {}, {}});
      },
      progress);
}

}  // namespace

void bind_commands(py::module_& module) {
  module.def("commands", &described_commands);
  module.def("run_command", &run_command);
}

}  // namespace alidade::python
