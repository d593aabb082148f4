#pragma once

#include <chrono>
#include <cstdint>
#include <filesystem>
#include <map>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/io/files.h"
#include "alidade/io/result_document.h"
#include "alidade/io/spool.h"

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
  int threads = 0;             ///< 0: all processors. Already in force when the command begins.
  std::uint64_t seed = 1;      ///< Of all chance in the command.
};

/// One run of one command: collects inputs, results and files, and writes them all at the end, or none.
class Run {
 public:
  Run(std::string command, std::vector<std::string> argv, CommonOptions options, Progress progress);

  const CommonOptions options;
  const Progress progress;  ///< Give it to the library's long work.
  ResultDocument document;  ///< Fill in counts, estimate, stddev, covariance, data and grids.

  /// Records a file that was read. Throws InputError if it cannot be read.
  void add_input(std::string role, const std::filesystem::path& file);
  /// The same where its bytes are at hand.
  void add_input(std::string role, std::string name, std::string_view bytes);
  /// Records the seconds since the last lap (or the start) under a name: "detect", "solve".
  void lap(std::string part);
  /// A file to be written into DIR by finish(). Many large ones wait on DIR's disk, not in memory.
  void add_file(std::string name, std::string content);
  /// A picture of the report: JPEG bytes under the name that the document uses.
  void add_picture(std::string name, std::string jpeg);
  /// A line for a person, shown by finish() unless --json or --quiet.
  void say(std::string line);

  /// Writes the files, result.json and report.html into DIR, prints the summary (or the document, with --json), and
  /// gives the exit code. Throws InputError if something cannot be written, Interrupted after Ctrl-C.
  [[nodiscard]] ExitCode finish(Verdict verdict);

 private:
  using Clock = std::chrono::steady_clock;

  /// A file for finish() to write: its content, or where that waits.
  struct PendingFile {
    std::string name;
    std::string content;
    std::optional<Spool::Place> place;
  };

  [[nodiscard]] std::string report(const std::string& result);
  void remove_older_files() const;
  void write_files(const std::string& result);
  void print(const std::string& result) const;

  Clock::time_point start_ = Clock::now();
  Clock::time_point lap_ = start_;
  std::vector<PendingFile> files_;
  std::size_t held_bytes_ = 0;  ///< Of the files in memory; beyond a limit they wait on disk.
  std::optional<Spool> spool_;
  std::map<std::string, std::string> pictures_;
  std::vector<std::string> lines_;
  bool has_report_ = false;
};

}  // namespace alidade::cli
