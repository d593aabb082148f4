#include "cli/app/run.h"

#include <stdio_ext.h>

#include <algorithm>
#include <cerrno>
#include <cstdio>

#include "alidade/files/sha256.h"
#include "alidade/results/file_verdict.h"
#include "alidade/results/thin_tables.h"
#include "cli/app/terminal.h"

namespace alidade::cli {
namespace {

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
  constexpr std::size_t longest = std::size_t{1} << 24U;  // films and tables say nothing
  if (bytes.size() < longest) {
    if (auto told = file_verdict(bytes)) told_.emplace_back(name, std::move(*told));
  }
  document.inputs.push_back({std::move(role), std::move(name), bytes.size(), sha256(bytes)});
}

void Run::lap(std::string part) {
  document.seconds.emplace_back(std::move(part), seconds_since(lap_));
  lap_ = Clock::now();
}

void Run::add_file(std::string name, std::string content) {
  constexpr std::size_t max_bytes = 256u << 20;  // as much as calibrate keeps of its photos
  document.files.push_back(name);
  if (held_bytes_ + content.size() > max_bytes) {
    if (!spool_) spool_.emplace(options.out);
    files_.push_back({std::move(name), "", spool_->put(content)});
    return;
  }
  held_bytes_ += content.size();
  files_.push_back({std::move(name), std::move(content), {}});
}

void Run::add_file_elsewhere(const std::filesystem::path& file, std::string_view content) {
  begin_writing();
  if (takes_bytes(file)) {
    streams_.push_back({file.string(), std::string(content)});
    return;
  }
  const std::filesystem::path place = place_of(file);
  elsewhere_.emplace_back(place.parent_path()).add(place.filename(), content);
}

void Run::write_streams() const {
  for (const NamedBytes& stream : streams_) write_file(stream.name, stream.bytes);
}

void Run::add_image(std::string name, std::string jpeg) { images_.push_back({std::move(name), std::move(jpeg)}); }

void Run::say(std::string line) { lines_.push_back(std::move(line)); }

ExitCode Run::finish(Verdict verdict) {
  document.verdict = std::move(verdict);
  for (const auto& [file, told] : told_) heed_file(file, told, document.command == "project", document.verdict);
  for (const auto& [doubt, remedy] : doubts_) {
    if (document.verdict.state != State::good) say(doubt + "; " + remedy);  // the verdict has another cause
    heed({.name = "inputs", .state = State::care, .text = doubt}, remedy, document.verdict);
  }
  settle(document);
  document.seconds.insert(document.seconds.begin(), {"total", seconds_since(start_)});
  if (options.keeps_outcome) {
    begin_writing();
    write_streams();
    for (FolderSwap& swap : elsewhere_) swap.commit();
    return document.verdict.exit_code;
  }
  result_ = result_text_of_size(document,
                                [&](std::string name, std::string csv) { add_file(std::move(name), std::move(csv)); });
  begin_writing();
  report_progress(progress, "writing", 0, 0);
  if (options.leaves_results) {
    write_files();
  } else {
    write_streams();
    print();
    for (FolderSwap& swap : elsewhere_) swap.commit();
  }
  return document.verdict.exit_code;
}

ExitCode Run::finish(JobOutcome outcome) {
  ResultDocument& from = outcome.document;
  std::vector<SkippedInput> skipped = std::move(document.counts.skipped);
  document.counts = std::move(from.counts);
  document.counts.skipped.insert(document.counts.skipped.begin(), skipped.begin(), skipped.end());
  document.inputs.insert(document.inputs.end(), from.inputs.begin(), from.inputs.end());
  document.assumed = std::move(from.assumed);
  document.estimate = std::move(from.estimate);
  document.stddev = std::move(from.stddev);
  document.stddev_model = std::move(from.stddev_model);
  document.covariance_names = std::move(from.covariance_names);
  document.covariance_upper = std::move(from.covariance_upper);
  document.data = std::move(from.data);
  document.grids = std::move(from.grids);
  for (std::string& line : outcome.lines) say(std::move(line));
  for (NamedBytes& file : outcome.files) add_file(std::move(file.name), std::move(file.bytes));
  for (NamedBytes& image : outcome.images) add_image(std::move(image.name), std::move(image.bytes));
  return finish(std::move(from.verdict));
}

JobOutcome Run::outcome() {
  JobOutcome kept{.document = std::move(document), .lines = std::move(lines_), .images = std::move(images_)};
  kept.document.files.clear();
  for (const PendingFile& file : files_) kept.files.push_back({file.name, content_of(file)});
  return kept;
}

void Run::write_files() {
  ResultFolder folder(options.out, document);
  folder_ = folder.path();
  folder.add("result.json", result_);
  for (const PendingFile& file : files_) folder.add(file.name, content_of(file));
  add_report(folder);
  report_progress(progress, "writing", 0, 0);  // the last moment at which Ctrl-C leaves nothing written
  write_streams();
  print();
  for (FolderSwap& each : elsewhere_) each.commit();
  folder.commit();
}

/// The page, where it is wanted. One that fails, or for which the disk has no room, never fails the run, but is
/// reported.
void Run::add_report(ResultFolder& folder) {
  if (options.no_report) return;
  try {
    folder.add_report(result_, std::move(images_));
    has_report_ = true;
  } catch (const std::exception& error) {
    warn(std::string("report: not written: ") + error.what());
  }
}

/// Said where a user reads it.
void Run::warn(const std::string& line) {
  if (options.json || options.quiet || !printed_file_.empty()) {
    tell_person("alidade: " + line);
  } else {
    say(line);
  }
}

std::string Run::summary() const {
  std::string text;
  const auto add = [&](const std::string& line) { text += line + "\n"; };
  for (const std::string& line : lines_) add(line);
  const Verdict& verdict = document.verdict;
  if (has_estimate(verdict) && !verdict.sentence.empty()) {
    add(std::string(symbol(verdict.state)) + " " + verdict.sentence);
    if (!verdict.to_add.empty()) add("  next: " + verdict.to_add);
  }
  if (!options.leaves_results) return text;
  if (folder_ != options.out)
    add("the results of an earlier run in " + options.out.string() + " are left as they were");
  add("result: " + (folder_ / "result.json").string());
  if (has_report_) add("report: " + (folder_ / "report.html").string());
  return text;
}

std::string Run::content_of(const PendingFile& file) const {
  return file.place ? spool_->get(*file.place) : file.content;
}

std::string Run::printed_text() const {
  if (options.json) return result_;
  if (printed_file_.empty()) return options.quiet ? "" : summary();
  const auto file = std::find_if(files_.begin(), files_.end(),
                                 [this](const PendingFile& each) { return each.name == printed_file_; });
  return file != files_.end() ? content_of(*file) : "";
}

/// Before anything stands in its place: a document that its reader cannot have is a run that failed. Who stops reading
/// lines for people has read enough.
void Run::print() const {
  wipe_progress_line();
  const std::string text = printed_text();
  const bool is_written = std::fwrite(text.data(), 1, text.size(), stdout) == text.size() && std::fflush(stdout) == 0;
  if (is_written) return;
  const bool has_read_enough = errno == EPIPE && !options.json && printed_file_.empty();
  ::__fpurge(stdout);
  std::clearerr(stdout);
  if (!has_read_enough) throw InputError("stdout: cannot be written");
}

}  // namespace alidade::cli
