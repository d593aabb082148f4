#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <chrono>
#include <memory>
#include <mutex>
#include <nlohmann/json.hpp>
#include <thread>

#include "alidade/live/server.h"
#include "alidade/report/markup.h"
#include "alidade/report/page.h"
#include "cli/app/app.h"
#include "cli/app/live.h"
#include "cli/app/terminal.h"
#include "cli/commands/commands.h"

namespace alidade::cli {
namespace {

namespace fs = std::filesystem;

struct ViewArgs {
  std::vector<fs::path> folders;
  LiveOptions where{.is_on = true, .port = {}, .address = {}};
};

/// One finished result.
struct Shown {
  std::string name;  ///< As in its address.
  fs::path folder;
  std::string state, sentence;
};

bool has_result(const fs::path& folder) {
  std::error_code ignored;
  return fs::is_regular_file(folder / "result.json", ignored);
}

Shown shown_of(const std::string& name, const fs::path& folder) {
  const auto json = nlohmann::json::parse(read_file(folder / "result.json"), nullptr, false);
  if (!json.is_object() || !json.contains("schema") || json["schema"] != "alidade-result/1")
    throw InputError((folder / "result.json").string() + ": is not a result of alidade");
  const auto verdict = json.value("verdict", nlohmann::json::object());
  const auto word = [&](const char* key) {
    return verdict.contains(key) && verdict[key].is_string() ? verdict[key].get<std::string>() : std::string();
  };
  return {name, folder, word("state"), word("sentence")};
}

/// The results in the folders, or in the folders in them: alidade-out has one of each command.
std::vector<Shown> results_in(const std::vector<fs::path>& folders) {
  std::vector<Shown> results;
  const auto add_one = [&](const fs::path& folder, std::string name) {
    const auto is_taken = [&](const std::string& n) {
      return std::ranges::find(results, n, &Shown::name) != results.end();
    };
    const std::string plain = name;
    for (int i = 2; is_taken(name); ++i) name = fmt::format("{}-{}", plain, i);
    results.push_back(shown_of(name, folder));
  };
  const auto add = [&](const fs::path& folder) {  // and what a later run was refused for
    const std::string name = fs::weakly_canonical(folder).filename().string();
    add_one(folder, name);
    if (has_result(folder / "refused")) add_one(folder / "refused", name + "-refused");
  };
  for (const fs::path& folder : folders) {
    if (!fs::is_directory(folder)) throw InputError(folder.string() + ": is not a folder");
    if (has_result(folder)) {
      add(folder);
      continue;
    }
    std::vector<fs::path> inner;
    for (const auto& entry : fs::directory_iterator(folder))
      if (entry.is_directory() && has_result(entry.path())) inner.push_back(entry.path());
    if (inner.empty()) throw InputError(folder.string() + ": has no result.json, and no folder in it has one");
    std::ranges::sort(inner);
    for (const fs::path& each : inner) add(each);
  }
  return results;
}

std::string list_page(const std::vector<Shown>& results, const std::string& query) {
  std::string rows;
  for (const Shown& result : results)
    rows += fmt::format("<tr><td><a href=\"/{0}/{1}\">{0}</a></td><td>{2}</td><td>{3}</td></tr>\n",
                        report::escaped(result.name), report::escaped(query), report::escaped(result.state),
                        report::escaped(result.sentence));
  return "<!DOCTYPE html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><title>alidade: results</title><style>\n"
         ":root{color-scheme:light dark}body{font:15px/1.5 system-ui,sans-serif;margin:2em "
         "auto;max-width:70em;padding:0 "
         "1em}td,th{padding:.35em 1.2em .35em 0;text-align:left;vertical-align:top}</style></head><body>\n"
         "<h1>Results</h1>\n<table><tr><th>run</th><th>state</th><th>what it says</th></tr>\n" +
         rows + "</table></body></html>\n";
}

/// Read on request: a run may have rewritten it.
live::HttpAnswer answer_of(const Shown& result, std::string_view file) {
  try {
    if (file == "result.json") return {200, "application/json", read_file(result.folder / "result.json")};
    if (!file.empty()) return {};
    std::error_code ignored;
    const bool has_page = fs::is_regular_file(result.folder / "report.html", ignored);
    return {200, "text/html; charset=utf-8",
            has_page ? read_file(result.folder / "report.html")
                     : report_page(read_file(result.folder / "result.json"), {})};
  } catch (const InputError& error) {
    return {404, "text/plain; charset=utf-8", std::string(error.what()) + "\n"};
  }
}

/// "/", "/NAME/" and its sibling files.
live::HttpAnswer answer(const std::vector<Shown>& results, std::string_view path, const std::string& query) {
  if (path == "/favicon.ico") return {204, "image/x-icon", ""};
  path.remove_prefix(1);
  if (results.size() == 1) {
    if (path.empty() || path == "result.json") return answer_of(results.front(), path);
  } else if (path.empty()) {
    return {200, "text/html; charset=utf-8", list_page(results, query)};
  }
  for (const Shown& result : results)
    if (path.starts_with(result.name + "/")) return answer_of(result, path.substr(result.name.size() + 1));
  return {};
}

ExitCode view(const ViewArgs& args, Run& run) {
  const std::vector<Shown> results = results_in(args.folders);
  live::ServerConfig config = server_config(args.where);
  std::string query;  // with the token, which links need as well
  std::mutex mutex;
  config.get = [&](std::string_view path) {
    const std::scoped_lock lock(mutex);
    return answer(results, path, query);
  };
  const live::Server server(std::move(config));
  const std::string url = server.url();
  {
    const std::scoped_lock lock(mutex);
    query = url.substr(std::min(url.find('?'), url.size()));
  }
  if (!run.options.quiet) {
    for (const Shown& result : results) fmt::print("{:<14} {}\n", result.name, result.sentence);
    fmt::print("{}\nCtrl-C ends it.\n", url);
    std::fflush(stdout);
  }
  while (interrupting_signal() == 0) std::this_thread::sleep_for(std::chrono::milliseconds(50));
  return ExitCode::ok;
}

}  // namespace

void add_view(App& app) {
  auto args = std::make_shared<ViewArgs>();
  CLI::App& command = app.add_command({.name = "view",
                                       .summary = "Show the reports of finished runs in a browser",
                                       .examples = "  alidade view alidade-out/track\n"
                                                   "  alidade view alidade-out           # a list of all in it\n"
                                                   "  alidade view monday tuesday --port 9000\n",
                                       .leaves_results = false},
                                      [args](Run& run) { return view(*args, run); });
  command.add_option("folders", args->folders, "Folders with a result.json, or folders that contain such folders")
      ->required();
  command.add_option("--port", args->where.port, "Port; 0: any free port (default: 8765)")->type_name("PORT");
  command
      .add_option("--address", args->where.address,
                  "Listen on this address instead of 127.0.0.1; clients then need the printed token")
      ->type_name("IP");
}

}  // namespace alidade::cli
