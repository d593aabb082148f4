#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <list>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/files/files.h"
#include "alidade/files/spool.h"
#include "alidade/results/file_verdict.h"
#include "alidade/results/outcome.h"
#include "alidade/results/result_document.h"
#include "alidade/results/result_folder.h"

namespace alidade::cli {

/// The command was called wrongly in a way that its options' own checks do not see. Exit code 2.
struct UsageError : std::runtime_error {
  using std::runtime_error::runtime_error;
};

/// What every command is given.
struct CommonOptions {
  std::filesystem::path out;  ///< --out, or alidade-out/COMMAND.
  bool out_is_given = false;
  bool json = false;
  bool quiet = false;
  bool no_report = false;
  bool leaves_results = true;  ///< False: nothing goes into DIR.
  bool keeps_outcome = false;  ///< finish() neither writes nor prints: outcome() has it all.
  int threads = 0;             ///< 0: all processors. Already in force when the command starts.
  std::uint64_t seed = 1;      ///< Of all chance in the command.
};

/// Whether there is an estimate, and files of it, usable or not to be trusted.
[[nodiscard]] inline bool has_estimate(const Verdict& verdict) {
  return is_estimate(static_cast<int>(verdict.exit_code));
}

/// One run of one command: collects inputs, results and files, and writes them all at the end, or none.
class Run {
 public:
  Run(std::string command, std::vector<std::string> argv, CommonOptions options, Progress progress);

  CommonOptions options;    ///< A command changes none of them but `out`, where another option means it.
  const Progress progress;  ///< Give it to the library's long work.
  ResultDocument document;  ///< Fill in counts, estimate, stddev, covariance, data and grids.

  /// Records a file that was read. Throws InputError if it cannot be read.
  void add_input(std::string role, const std::filesystem::path& file);
  /// The same where its bytes are at hand.
  void add_input(std::string role, std::string name, std::string_view bytes);
  /// What is in doubt about an input, and what would tell: no answer is good then.
  void add_doubt(std::string doubt, std::string remedy) { doubts_.emplace_back(std::move(doubt), std::move(remedy)); }
  /// Records the seconds since the last lap (or the start) under a name: "detect", "solve".
  void lap(std::string part);
  /// A file to be written into DIR by finish(). Many large ones wait on DIR's disk, not in memory.
  void add_file(std::string name, std::string content);
  /// A file elsewhere that the user named, written by finish() as well; a device or a pipe is written to, of a link
  /// what it points to is replaced.
  void add_file_elsewhere(const std::filesystem::path& file, std::string_view content);
  /// The file of that name is all that finish() prints, if there is one: a table for the next program.
  void print_file(std::string name) { printed_file_ = std::move(name); }
  /// An image of the report: JPEG bytes under the name that the document uses. Where the page would become too large,
  /// those added last are dropped.
  void add_image(std::string name, std::string jpeg);
  /// A printed line, shown by finish() unless --json or --quiet.
  void say(std::string line);

  /// Writes the files, result.json and report.html into DIR, prints the summary (or the document, with --json), and
  /// gives the exit code. Everything is in DIR, or DIR is unchanged: throws InputError if something cannot be written
  /// or printed, Interrupted after Ctrl-C. A refusal does not replace an earlier estimate: it goes to DIR/refused.
  [[nodiscard]] ExitCode finish(Verdict verdict);
  /// The same with all that a job of the library leaves; earlier messages and skipped items come first.
  [[nodiscard]] ExitCode finish(JobOutcome outcome);
  /// What finish() was to write, and the lines; after finish() with options.keeps_outcome.
  [[nodiscard]] JobOutcome outcome();
  /// Text of result.json; empty before finish().
  [[nodiscard]] const std::string& result() const { return result_; }
  /// The page that finish() wrote; empty where it wrote none.
  [[nodiscard]] std::filesystem::path report() const { return has_report_ ? folder_ / "report.html" : ""; }

 private:
  using Clock = std::chrono::steady_clock;

  /// A file for finish() to write: its content, or where that waits.
  struct PendingFile {
    std::string name;
    std::string content;
    std::optional<Spool::Place> place;
  };

  void write_files();
  void add_report(ResultFolder& folder);
  void warn(const std::string& line);
  void print() const;
  void write_streams() const;
  [[nodiscard]] std::string summary() const;
  [[nodiscard]] std::string content_of(const PendingFile& file) const;
  [[nodiscard]] std::string printed_text() const;

  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
  std::vector<PendingFile> files_;
  std::size_t held_bytes_ = 0;  ///< Of the files in memory; beyond a limit they wait on disk.
  std::optional<Spool> spool_;
  std::list<FolderSwap> elsewhere_;
  std::vector<NamedBytes> streams_;  ///< Devices and pipes elsewhere, and what they get.
  std::vector<NamedBytes> images_;   ///< JPEG, the most wanted first.
  std::vector<std::string> lines_;
  std::string result_, printed_file_;
  std::filesystem::path folder_;  ///< Where the results stand: DIR, or DIR/refused.
  bool has_report_ = false;
  std::vector<std::pair<std::string, std::string>> doubts_;  ///< And remedies.
  std::vector<std::pair<std::string, FileVerdict>> told_;    ///< Of inputs that come from an answer that is not good.
};

}  // namespace alidade::cli
