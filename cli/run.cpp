#include "cli/run.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <nlohmann/json.hpp>
#include <tuple>

#include "alidade/io/sha256.h"
#include "alidade/report/page.h"

namespace alidade::cli {
namespace {

std::string utc_now() {
  const std::time_t now = std::time(nullptr);
  std::tm parts{};
  ::gmtime_r(&now, &parts);
  std::string text(32, '\0');
  text.resize(std::strftime(text.data(), text.size(), "%Y-%m-%dT%H:%M:%SZ", &parts));
  return text;
}

const char* symbol(State state) {
  switch (state) {
    case State::good:
      return "●";
    case State::care:
      return "◆";
    case State::bad:
      return "▲";
    case State::refused:
      return "■";
    case State::not_converged:
      return "✕";
  }
  return "?";
}

void print_line(std::string_view line) { std::printf("%.*s\n", static_cast<int>(line.size()), line.data()); }

double seconds_since(std::chrono::steady_clock::time_point then) {
  return std::chrono::duration<double>(std::chrono::steady_clock::now() - then).count();
}

}  // namespace

Run::Run(std::string command, std::vector<std::string> argv, CommonOptions common, Progress report_to)
    : options(std::move(common)), progress(std::move(report_to)) {
  document.command = std::move(command);
  document.argv = std::move(argv);
  document.created_utc = utc_now();
}

void Run::add_input(std::string role, const std::filesystem::path& file) {
  add_input(std::move(role), file.string(), read_file(file));
}

void Run::add_input(std::string role, std::string name, std::string_view bytes) {
  document.inputs.push_back({std::move(role), std::move(name), bytes.size(), sha256(bytes)});
}

void Run::lap(std::string part) {
  document.seconds.emplace_back(std::move(part), seconds_since(lap_));
  lap_ = Clock::now();
}

void Run::add_file(std::string name, std::string content) {
  constexpr std::size_t most_bytes = 256u << 20;  // as much as calibrate keeps of its photos
  document.files.push_back(name);
  if (held_bytes_ + content.size() > most_bytes) {
    if (!spool_) spool_.emplace(options.out);
    files_.push_back({std::move(name), "", spool_->put(content)});
    return;
  }
  held_bytes_ += content.size();
  files_.push_back({std::move(name), std::move(content), {}});
}

void Run::add_picture(std::string name, std::string jpeg) { pictures_[std::move(name)] = std::move(jpeg); }

void Run::say(std::string line) { lines_.push_back(std::move(line)); }

ExitCode Run::finish(Verdict verdict) {
  document.verdict = std::move(verdict);
  if (document.verdict.state == State::bad && document.verdict.exit_code == ExitCode::ok) {
    document.verdict.exit_code = ExitCode::not_trusted;
  }
  // Photos are read by many threads, in any order; the document has one order.
  std::stable_sort(document.inputs.begin(), document.inputs.end(), [](const InputFile& a, const InputFile& b) {
    return std::tie(a.role, a.name) < std::tie(b.role, b.name);
  });
  document.seconds.insert(document.seconds.begin(), {"total", seconds_since(start_)});
  const std::string result = result_text(document);
  report_progress(progress, "writing", 0, 0);  // the last moment at which Ctrl-C leaves nothing written
  if (options.leaves_results) write_files(result);
  print(result);
  return document.verdict.exit_code;
}

void Run::write_files(const std::string& result) {
  const std::string page = report(result);
  remove_older_files();
  for (const PendingFile& file : files_) {
    write_file(options.out / file.name, file.place ? spool_->get(*file.place) : file.content);
  }
  write_file(options.out / "result.json", result);
  has_report_ = !page.empty();
  if (has_report_) write_file(options.out / "report.html", page);
}

/// The page; empty where it is not wanted or fails. A failed report never fails the run, but it says so.
std::string Run::report(const std::string& result) {
  if (options.no_report) return "";
  try {
    return report_page(result, pictures_);
  } catch (const std::exception& error) {
    say(std::string("report: failed: ") + error.what());
    return "";
  }
}

/// What an earlier run left here and this one does not replace must not be taken for this one's: a camera.yaml beside a
/// refusal. Only files that the earlier result.json names are removed.
void Run::remove_older_files() const {
  std::error_code ignored;
  if (!std::filesystem::exists(options.out / "result.json", ignored)) return;
  const auto older = nlohmann::json::parse(read_file(options.out / "result.json"), nullptr, false);
  if (!older.is_object() || older.value("schema", "") != "alidade-result/1" || !older.contains("files")) return;
  for (const auto& name : older["files"]) {
    const std::filesystem::path file = name.is_string() ? name.get<std::string>() : "";
    const bool is_inside =
        !file.empty() && file.is_relative() && file == file.lexically_normal() && *file.begin() != "..";
    if (is_inside && file.has_filename()) std::filesystem::remove(options.out / file, ignored);
  }
  std::filesystem::remove(options.out / "report.html", ignored);
}

void Run::print(const std::string& result) const {
  if (options.json) {
    std::fwrite(result.data(), 1, result.size(), stdout);
    return;
  }
  if (options.quiet) return;
  for (const std::string& line : lines_) print_line(line);
  const Verdict& verdict = document.verdict;
  const bool has_estimate = verdict.exit_code == ExitCode::ok || verdict.exit_code == ExitCode::not_trusted;
  if (has_estimate && !verdict.sentence.empty()) {
    print_line(std::string(symbol(verdict.state)) + " " + verdict.sentence);
    if (!verdict.to_add.empty()) print_line("  next: " + verdict.to_add);
  }
  if (!options.leaves_results) return;
  print_line("result: " + (options.out / "result.json").string());
  if (has_report_) print_line("report: " + (options.out / "report.html").string());
}

}  // namespace alidade::cli
