#include "cli/app/app.h"

#include <fmt/format.h>
#include <tbb/global_control.h>
#include <tbb/info.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <charconv>
#include <cstdint>
#include <cstdio>
#include <deque>
#include <iostream>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>
#include <optional>
#include <utility>

#include "alidade/estimation/config_error.h"
#include "cli/app/field_options.h"
#include "cli/app/help_format.h"
#include "cli/app/out_of_memory.h"
#include "cli/app/standard_input.h"
#include "cli/app/terminal.h"
#include "cli/app/usage_fault.h"

namespace alidade::cli {

struct App::Command {
  CommandSpec spec;
  CLI::App* app = nullptr;
  std::function<ExitCode(Run&)> work;
  CommonOptions options;
  FieldList fields;              ///< Empty where the options are not described by fields.
  std::filesystem::path config;  ///< --config, or empty.
};

struct App::State {
  CLI::App app{"alidade: calibrate what moves. Cameras you can trust, from photos, with their uncertainty.", "alidade"};
  std::deque<Command> commands;        // options point into it: it must not move
  std::unique_ptr<Terminal> terminal;  ///< Of a command that was typed.
  std::string first_word;
};

namespace {

constexpr std::uint64_t largest_seed = std::uint64_t{1} << 62U;

/// What every command has.
void add_common_options(CLI::App& app, const CommandSpec& spec, CommonOptions& options) {
  options.out = std::filesystem::path("alidade-out") / spec.name.substr(0, spec.name.find(' '));
  const std::string group = "Common options";
  app.add_option("--out", options.out, "Folder for the results")->type_name("DIR")->capture_default_str()->group(group);
  app.add_flag("--json", options.json, "Print one JSON document on stdout, nothing else")->group(group);
  app.add_flag("--quiet", options.quiet, "Print nothing on stdout")->group(group);
  app.add_flag("--no-report", options.no_report, "Write no report.html")->group(group);
  app.add_option("--threads", options.threads, "Maximum number of threads; 0: one per processor")
      ->type_name("N")
      ->check(CLI::Range(0, 1024))
      ->capture_default_str()
      ->group(group);
  if (!spec.draws_random_numbers) return;
  app.add_option("--seed", options.seed, "Random seed; same seed, same result")
      ->type_name("N")
      ->check(CLI::Range(std::uint64_t{0}, largest_seed))
      ->capture_default_str()
      ->group(group);
}

/// A command's fields, and what every command has: all of them may stand in a config file.
FieldList with_common_fields(FieldList fields, const CommandSpec& spec, CommonOptions& options) {
  const auto text_of_out = [&options] { return options.out.string(); };
  const auto take_out = [&options](const std::string& text) {
    options.out = text;
    return std::string();
  };
  fields.push_back({.name = "out", .value = TextCode{take_out, text_of_out}, .help = "", .option = "--out"});
  fields.push_back({.name = "json", .value = &options.json, .help = "", .option = "--json"});
  fields.push_back({.name = "quiet", .value = &options.quiet, .help = "", .option = "--quiet"});
  fields.push_back({.name = "no_report", .value = &options.no_report, .help = "", .option = "--no-report"});
  fields.push_back(
      {.name = "threads", .value = &options.threads, .help = "", .limits = {0, 1024}, .option = "--threads"});
  if (!spec.draws_random_numbers) return fields;
  const auto take_seed = [&options](const std::string& text) -> std::string {
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), options.seed);
    const bool is_seed = error == std::errc{} && end == text.data() + text.size() && options.seed <= largest_seed;
    return is_seed ? "" : "'" + text + "' is not a whole number from 0 to " + std::to_string(largest_seed);
  };
  const auto text_of_seed = [&options] { return std::to_string(options.seed); };
  fields.push_back({.name = "seed", .value = TextCode{take_seed, text_of_seed}, .help = "", .option = "--seed"});
  return fields;
}

/// Finds out before the work, not after it, that the results cannot be written; leaves nothing there.
void require_place(const CommonOptions& options) {
  if (options.out.empty()) throw UsageError("--out: is empty; a folder is needed");
  if (!options.leaves_results) return;
  try {
    const FolderSwap tried(options.out);
  } catch (const InputError& error) {
    throw InputError(std::string(error.what()) + "; give another --out");
  }
}

/// Threads and foreign libraries as the options say. The limit lasts as long as what is returned.
tbb::global_control prepare_libraries(int threads) {
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::setNumThreads(threads == 0 ? -1 : threads);
  const int limit = threads == 0 ? tbb::info::default_concurrency() : threads;
  return {tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(limit)};
}

/// "sigma_px" of "--sigma-px", and of an argument its own name.
std::string identifier_of(const CLI::Option& option) {
  std::string name = option.get_lnames().empty() ? option.get_name(true) : option.get_lnames().front();
  std::ranges::replace(name, '-', '_');
  return name;
}

OptionInfo option_info(const CLI::Option& option, const FieldList& fields) {
  OptionInfo info{.name = identifier_of(option),
                  .help = option.get_description(),
                  .standard = option.get_default_str(),
                  .group = option.get_group(),
                  .is_required = option.get_required(),
                  .is_list = option.get_items_expected_max() > 1};
  if (!option.get_lnames().empty()) info.option = "--" + option.get_lnames().front();
  const bool is_flag = option.get_type_size() == 0 || option.get_expected_max() == 0;
  if (!is_flag) info.form = words_of_type(option.get_type_name().empty() ? "TEXT" : option.get_type_name());
  for (const Field& field : fields) {
    if (option_of(field) != info.option) continue;
    info.name = field.name;
    if (!is_flag) info.form = form_text(field);
    info.is_required = field.is_required;
  }
  return info;
}

std::string refusal(const std::string& command, const Verdict& verdict) {
  const bool is_said = verdict.exit_code != ExitCode::not_trusted || verdict.sentence.starts_with("Not to be trusted");
  return command + ": " + (is_said ? "" : "not to be trusted: ") + verdict.sentence +
         (verdict.to_add.empty() ? "" : "; " + verdict.to_add);
}

constexpr const char* bug = " (a bug in alidade; please report it)";

}  // namespace

App::App() : state_(std::make_unique<State>()) {
  CLI::App& app = state_->app;
  app.set_version_flag("--version", "alidade " ALIDADE_VERSION);
  app.set_help_flag("--help,-h", "Print this help");
  app.require_subcommand(1);
  app.formatter(std::make_shared<HelpFormat>());
  app.footer(
      "Start with simulated photos, or with your own:\n"
      "    alidade simulate board --board 9x6 --square 0.025 --out photos\n"
      "    alidade calibrate photos --board 9x6 --square 0.025\n"
      "Each command has its own help with examples: alidade COMMAND --help\n"
      "Exit codes: 0 valid estimate, 1 internal error of alidade, 2 usage error, 3 invalid input (nothing is "
      "written),\n"
      "4 the data do not determine the answer (what is missing is named), 5 no convergence, 6 estimate not to be "
      "trusted\n"
      "(files are written), 130 interrupted.\n"
      "Results replace earlier ones in DIR in one step, at the end. A failed run leaves earlier results unchanged; "
      "where\n"
      "they hold an estimate, a refusal (4, 5) is written to DIR/refused.");
}

App::~App() = default;

void App::add_group(const std::string& name, const std::string& summary) {
  CLI::App* group = state_->app.add_subcommand(name, summary)->require_subcommand(1);
  group->footer("Each command has its own help with examples: alidade " + name + " COMMAND --help");
}

CLI::App& App::add_command(const CommandSpec& spec, std::function<ExitCode(Run&)> work) {
  const std::size_t space = spec.name.find(' ');
  CLI::App* parent = &state_->app;
  if (space != std::string::npos) parent = parent->get_subcommand(spec.name.substr(0, space));
  CLI::App* app =
      parent->add_subcommand(space == std::string::npos ? spec.name : spec.name.substr(space + 1), spec.summary);
  Command& command = state_->commands.emplace_back(Command{spec, app, std::move(work), {}, {}, {}});
  command.options.leaves_results = spec.leaves_results;
  app->footer("Examples:\n" + indented_examples(spec.examples));
  return *app;
}

void App::add_fields(CLI::App& app, FieldList fields) {
  for (Command& command : state_->commands) {
    if (command.app != &app) continue;
    command.fields = std::move(fields);
    cli::add_fields(app, command.fields);
    app.add_option("--config", command.config, "Options from a file, `name: value`; the command line overrides it")
        ->type_name("FILE.yaml");
  }
}

App::Command* App::chosen_command() {
  for (Command& command : state_->commands) {
    if (command.app->parsed()) return &command;
  }
  return nullptr;
}

std::vector<CommandInfo> App::commands() {
  std::vector<CommandInfo> all;
  for (Command& command : state_->commands) {
    add_common_options(*command.app, command.spec, command.options);
    CommandInfo& info = all.emplace_back(CommandInfo{command.spec.name, command.spec.summary, {}});
    for (const CLI::Option* option : command.app->get_options()) {
      if (option->get_group().empty() || option == command.app->get_help_ptr()) continue;
      info.options.push_back(option_info(*option, command.fields));
    }
  }
  return all;
}

JobOutcome App::run_job(const std::vector<std::string>& words, const Progress& progress) {
  CLI::App& app = state_->app;
  for (Command& command : state_->commands) add_common_options(*command.app, command.spec, command.options);
  try {
    std::vector<std::string> last_first(words.rbegin(), words.rend());
    app.parse(last_first);
  } catch (const CLI::ParseError& error) {
    throw UsageError(usage_fault(app, error));
  }
  Command& command = *chosen_command();
  CommonOptions& options = command.options;
  take_config(*command.app, with_common_fields(command.fields, command.spec, command.options), command.config);
  options.leaves_results = false;
  options.keeps_outcome = options.quiet = true;
  std::optional<tbb::global_control> limit;  // the program's own use of libraries stays as it is
  if (options.threads > 0) {
    limit.emplace(tbb::global_control::max_allowed_parallelism, static_cast<std::size_t>(options.threads));
  }
  Run run(command.spec.name, words, options, progress);
  if (command.spec.draws_random_numbers) run.document.seed = options.seed;
  static_cast<void>(command.work(run));
  return run.outcome();
}

int App::dispatch(int argc, const char* const* argv) {
  CLI::App& app = state_->app;
  for (Command& command : state_->commands)  // behind the command's own, in its help as well
    add_common_options(*command.app, command.spec, command.options);
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& error) {
    const bool asks_for_help = error.get_exit_code() == 0;  // or for the version
    if (asks_for_help && !names_unknown_command(app)) return app.exit(error);
    throw UsageError(usage_fault(app, error));
  }
  Command& command = *chosen_command();
  for (const std::string_view word : std::vector<std::string_view>(argv + 1, argv + argc))
    if (lacks_a_number(word)) throw UsageError(fmt::format("{}: '{}' lacks a number", command.spec.name, word));
  CommonOptions& options = command.options;
  take_config(*command.app, with_common_fields(command.fields, command.spec, command.options), command.config);
  if (command.app->count("--out") > 0) options.leaves_results = true;
  catch_interrupts();
  require_place(options);
  keep_piped_files({argv + 1, argv + argc});
  const tbb::global_control limit = prepare_libraries(options.threads);
  Run run(command.spec.name, {argv, argv + argc}, options, state_->terminal->progress(!options.quiet && !options.json));
  if (command.spec.draws_random_numbers) run.document.seed = options.seed;
  const CLI::Option* live = command.app->get_option_no_throw("--live");
  std::optional<StopsAtOnce> stops;
  if (command.spec.writes_at_end && (live == nullptr || live->count() == 0)) stops.emplace();
  try {
    const ExitCode code = command.work(run);
    state_->terminal->wipe_progress();
    if (code != ExitCode::ok) state_->terminal->error(refusal(command.spec.name, run.document.verdict));
    return static_cast<int>(code);
  } catch (const UsageError& error) {
    throw UsageError(command.spec.name + ": " + error.what());
  } catch (const ConfigError& error) {
    throw UsageError(command.spec.name + ": " + error.what());
  }
}

const std::string& App::first_word() const { return state_->first_word; }

void App::set_first_word(const std::string& word) { state_->first_word = word; }

namespace {

/// "help calibrate" is "calibrate --help", as in git.
std::vector<const char*> words_of(int argc, const char* const* argv) {
  std::vector<const char*> words(argv, argv + argc);
  if (argc > 1 && std::string_view(argv[1]) == "help") {
    words.erase(words.begin() + 1);
    words.push_back("--help");
  }
  return words;
}

}  // namespace

int run_cli(int argc, const char* const* argv, void (*add_commands)(App&)) {
  hold_standard_streams();
  prepare_for_out_of_memory();
  App frame;
  frame.state_->terminal = std::make_unique<Terminal>();
  const auto failed = [&](const std::string& message, ExitCode code) {
    frame.state_->terminal->error(message);
    return static_cast<int>(code);
  };
  try {
    const std::vector<const char*> words = words_of(argc, argv);
    if (words.size() > 1) frame.set_first_word(words[1]);
    add_commands(frame);
    const int code = frame.dispatch(static_cast<int>(words.size()), words.data());
    std::cout.flush();
    const bool is_written = std::cout.good() && std::fflush(stdout) == 0 && std::ferror(stdout) == 0;
    return is_written ? code : failed("stdout: cannot be written", ExitCode::bad_input);
  } catch (const UsageError& error) {
    return failed(error.what(), ExitCode::usage);
  } catch (const Interrupted& error) {
    frame.state_->terminal->error(error.what());
    return 128 + interrupting_signal();
  } catch (const InputError& error) {
    return failed(error.what(), ExitCode::bad_input);
  } catch (const std::filesystem::filesystem_error& error) {
    return failed(error.path1().string() + ": " + error.code().message(), ExitCode::bad_input);
  } catch (const std::bad_alloc&) {
    tell_out_of_memory();
    return static_cast<int>(ExitCode::internal_error);
  } catch (const cv::Exception& error) {
    return failed("internal: OpenCV: " + error.err + bug, ExitCode::internal_error);
  } catch (const std::exception& error) {
    return failed(std::string("internal: ") + error.what() + bug, ExitCode::internal_error);
  } catch (...) {
    return failed(std::string("internal: unknown") + bug, ExitCode::internal_error);
  }
}

}  // namespace alidade::cli
