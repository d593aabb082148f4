#include "cli/app/live.h"

#include <CLI/CLI.hpp>
#include <charconv>
#include <nlohmann/json.hpp>

#include "alidade/live/foxglove.h"
#include "alidade/live/streams.h"
#include "alidade/report/page.h"
#include "cli/app/option_checks.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

using Json = nlohmann::ordered_json;

/// `hint`: what else the option may have taken it for.
std::uint16_t port_of(const std::string& text, const std::string& hint = "") {
  if (text.empty()) return 8765;
  std::uint16_t port = 0;
  const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), port);
  if (error != std::errc{} || end != text.data() + text.size())
    throw UsageError("'" + text + "' is not a port, 0 to 65535" + hint);
  return port;
}

/// Rows of one topic as the tables of the result; the rows of track are of two.
Json tables_of(const std::string& command, const std::vector<std::string>& rows) {
  Json tables = Json::object();
  for (const std::string& text : rows) {
    const Json row = Json::parse(text);
    std::string table = command == "servo"      ? "control"
                        : command == "localize" ? "path"
                        : command == "head"     ? "follow"
                                                : "steps";
    for (const auto& [name, value] : row.items()) {
      if (name == "t_capture_s") table = "measurements";
      tables[table][name].push_back(value);
    }
  }
  return tables;
}

}  // namespace

void add_live_options(CLI::App& command, LiveOptions& options, bool has_pace) {
  const std::string group = "Live view";
  command
      .add_option_function<std::string>(
          "--live",
          [&options](const std::string& port) {
            options.is_on = true;
            options.port = port;
          },
          "Show the run live: web page and Foxglove server on this port; 0: any free port (default: 8765)")
      ->type_name("[PORT]")
      ->expected(0, 1)
      ->group(group);
  command
      .add_option("--live-address", options.address,
                  "Listen on this address instead of 127.0.0.1; clients then need the printed token")
      ->type_name("IP")
      ->group(group);
  if (!has_pace) return;
  command
      .add_option("--live-pace", options.pace,
                  "Playback speed relative to the recording; 1: real time (default: as fast as computed)")
      ->type_name("X")
      ->check(positive_number())
      ->group(group);
}

live::ServerConfig server_config(const LiveOptions& options) {
  live::ServerConfig config;
  if (!options.address.empty()) config.address = options.address;
  config.port = port_of(options.port);
  return config;
}

LiveRun::LiveRun(const LiveOptions& options, Run& run) : options_(options), run_(run), pace_(options.pace) {
  if (!options.is_on && !options.address.empty()) throw UsageError("--live-address: only with --live");
  if (!options.is_on && options.pace > 0.0) throw UsageError("--live-pace: only with --live");
  if (options.is_on) (void)port_of(options.port, "; after --live without one, files do not follow");
}

LiveRun::~LiveRun() {
  if (!server_ || !result_.empty()) return;
  server_->tell(live::StatusLevel::error, "the run has stopped without a result");
  server_->finish(0.3);
}

void LiveRun::open(std::vector<live::Topic> topics, std::string row_topic) {
  if (!is_on()) return;
  row_topic_ = std::move(row_topic);
  live::ServerConfig config = server_config(options_);
  config.topics = std::move(topics);
  config.end_topic = live::end_topic;
  config.get = [this](std::string_view path) { return answer(path); };
  try {
    server_ = std::make_unique<live::Server>(std::move(config));
  } catch (const InputError& error) {
    throw InputError(std::string("--live: ") + error.what());
  }
  tell_person("live: " + server_->url());
}

Progress LiveRun::progress() {
  if (!server_) return run_.progress;
  return [this](std::string_view what, std::size_t done, std::size_t total) {
    server_->send("/progress", 0, [word = std::string(what), done, total] {
      return Json{{"what", word}, {"done", done}, {"total", total}}.dump();
    });
    return !run_.progress || run_.progress(what, done, total);
  };
}

void LiveRun::keep_pace(double t_s) {
  if (server_) pace_.keep(t_s);
}

ExitCode LiveRun::finish(Verdict verdict) { return tell_end(run_.finish(std::move(verdict))); }

ExitCode LiveRun::finish(JobOutcome outcome) { return tell_end(run_.finish(std::move(outcome))); }

ExitCode LiveRun::tell_end(ExitCode code) {
  if (!server_) return code;
  const Verdict& verdict = run_.document.verdict;
  {
    const std::scoped_lock lock(mutex_);
    result_ = run_.result();
  }
  const std::string sentence = verdict.sentence + (verdict.to_add.empty() ? "" : "; " + verdict.to_add);
  const auto level = code == ExitCode::ok            ? live::LogLevel::info
                     : code == ExitCode::not_trusted ? live::LogLevel::warning
                                                     : live::LogLevel::error;
  server_->send(
      "/log", 0, [=, this] { return live::log_text(0, level, run_.document.command, sentence); }, 0, true);
  server_->send(
      live::end_topic, 0,
      [code, sentence, state = verdict.state] {
        return Json{{"state", state_name(state)}, {"exit_code", static_cast<int>(code)}, {"sentence", sentence}}.dump();
      },
      0, true);
  constexpr double max_s = 3.0;  // for a browser on a busy machine to fetch the result
  server_->finish(max_s);
  return code;
}

live::HttpAnswer LiveRun::answer(std::string_view path) {
  const std::scoped_lock lock(mutex_);
  if (path == "/result.json") return {200, "application/json", result_.empty() ? document_so_far(true) : result_};
  if (path == "/")
    return {200, "text/html; charset=utf-8", report_page(result_.empty() ? document_so_far(false) : result_, {})};
  if (path == "/favicon.ico") return {204, "image/x-icon", ""};
  return {};
}

std::string LiveRun::document_so_far(bool has_data) {
  const ResultDocument& document = run_.document;
  const Json json{{"schema", "alidade-result/1"},
                  {"command", document.command},
                  {"version", ALIDADE_VERSION},
                  {"argv", document.argv},
                  {"created_utc", document.created_utc},
                  {"live", true},
                  {"verdict",
                   {{"state", "running"},
                    {"exit_code", nullptr},
                    {"sentence", "Still running"},
                    {"to_add", nullptr},
                    {"checks", Json::array()}}},
                  {"data", has_data ? tables_of(document.command, server_->kept(row_topic_)) : Json::object()}};
  return json.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
}

}  // namespace alidade::cli
