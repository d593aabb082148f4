#pragma once

#include <functional>
#include <memory>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "cli/app/run.h"

namespace CLI {  // NOLINT(readability-identifier-naming): CLI11's
class App;
}

namespace alidade::cli {

/// What a command is called and how it presents itself.
struct CommandSpec {
  std::string name;                   ///< "calibrate"; with a space, "camera show", a command of a group.
  std::string summary;                ///< One line.
  std::string examples;               ///< Command lines, one per line; shown at the end of --help.
  bool draws_random_numbers = false;  ///< Gives it --seed.
  bool leaves_results = true;         ///< False: nothing is written into DIR unless --out is given (show, convert).
  /// Writes nothing before Run::finish, but with --live: Ctrl-C ends it at once, wherever it is.
  bool writes_at_end = false;
};

/// An option of a command, or one of its arguments.
struct OptionInfo {
  std::string name;      ///< Of its field, else the option's as an identifier: "sigma_px".
  std::string option;    ///< "--sigma-px"; empty: an argument.
  std::string help;      ///< One line.
  std::string form;      ///< Placeholder of its value: "NUMBER > 0"; empty: a flag.
  std::string standard;  ///< Its default; empty: none.
  std::string group;     ///< Heading in help.
  bool is_required = false;
  bool is_list = false;  ///< Takes several values.
};
struct CommandInfo {
  std::string name, summary;
  std::vector<OptionInfo> options;
};

/// The commands and what they share: options, threads, errors, exit codes. See cli/commands.h.
class App {
 public:
  App();
  ~App();
  App(const App&) = delete;
  App& operator=(const App&) = delete;

  /// A command. `work` runs after the whole line has been parsed; it ends with `return run.finish(verdict);`. Add the
  /// command's own options to what is returned.
  CLI::App& add_command(const CommandSpec& spec, std::function<ExitCode(Run&)> work);
  /// The command's options, as its fields describe them; it gets --config FILE as well. Once for a command.
  void add_fields(CLI::App& command, FieldList fields);
  /// The word before the commands of a group: "camera" of "camera show". Comes before them.
  void add_group(const std::string& name, const std::string& summary);

  /// The word that the line begins with, where it is known before commands are added: those that it
  /// does not name need not be added. Empty: all are needed.
  [[nodiscard]] const std::string& first_word() const;
  void set_first_word(const std::string& word);

  /// The commands with their options, for another front end than the command line. Once for an App.
  [[nodiscard]] std::vector<CommandInfo> commands();
  /// Runs a command in a program, which gets what the command would have written: `words` as they are typed, without
  /// the executable. Throws UsageError, ConfigError and InputError with the line that the command would print,
  /// Interrupted where `progress` says stop. Once for an App.
  [[nodiscard]] JobOutcome run_job(const std::vector<std::string>& words, const Progress& progress);

 private:
  friend int run_cli(int argc, const char* const* argv, void (*add_commands)(App&));
  struct Command;
  struct State;

  int dispatch(int argc, const char* const* argv);
  Command* chosen_command();

  std::unique_ptr<State> state_;
};

/// Parses, runs the chosen command, and is the only place that turns exceptions into a line and an exit code.
[[nodiscard]] int run_cli(int argc, const char* const* argv, void (*add_commands)(App&));

}  // namespace alidade::cli
