#include <fmt/format.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <set>

#include "alidade/results/batch_outcome.h"
#include "alidade/tables/jobs_file.h"
#include "cli/app/app.h"
#include "cli/app/child_process.h"
#include "cli/app/terminal.h"
#include "cli/commands/commands.h"
#include "cli/commands/shard_option.h"

namespace alidade::cli {
namespace {

struct BatchArgs {
  std::filesystem::path jobs;
  std::string shard;
  bool resume = false, row_reports = false;
};

/// "rows/00017-cam_17"
std::string row_folder(std::size_t i, const std::string& camera) {
  std::string name;
  for (const char c : camera.substr(0, 60)) {
    const bool is_plain = std::isalnum(static_cast<unsigned char>(c)) != 0 || c == '-' || c == '_' || c == '.';
    name += is_plain ? c : '_';
  }
  return fmt::format("rows/{:06}-{}", i + 1, name);
}

/// Options that a row may not have: the batch decides where results go; what does not end or only prints has no result.
std::string fault_of(const std::vector<std::string>& words) {
  static const std::set<std::string> without_result{"view", "batch", "study", "fleet", "help", "schema"};
  if (without_result.contains(words.front())) return "'" + words.front() + "' has no result that a batch could collect";
  for (const std::string& word : words) {
    if (word == "--help" || word == "-h" || word == "--version")
      return word + " has no result that a batch could collect";
    for (const char* const taken : {"--out", "--json", "--live"}) {
      if (word == taken || word.starts_with(std::string(taken) + "="))
        return std::string(taken) + " is set by the batch";
    }
  }
  return "";
}

bool has_option(const std::vector<std::string>& words, const std::string& option) {
  return std::ranges::any_of(words,
                             [&](const std::string& word) { return word == option || word.starts_with(option + "="); });
}

std::string last_line(std::string text) {
  while (!text.empty() && text.back() == '\n') text.pop_back();
  return one_line(text.substr(text.rfind('\n') == std::string::npos ? 0 : text.rfind('\n') + 1));
}

/// The ranks of an MPI or Slurm job are its shards, where no --shard is given.
std::string shard_of_rank() {
  const char* const rank = std::getenv("OMPI_COMM_WORLD_RANK");
  const char* const size = std::getenv("OMPI_COMM_WORLD_SIZE");
  return rank != nullptr && size != nullptr ? std::string(rank) + "/" + size : "";
}

class Lot {
 public:
  Lot(const BatchArgs& args, std::vector<BatchJob> jobs, Run& run)
      : args_(args), jobs_(std::move(jobs)), run_(run), rows_(jobs_.size()) {}

  /// The rows of a shard: those that an earlier run did not do.
  void work(const Shard& shard) {
    std::vector<std::size_t> remaining;
    for (std::size_t i = 0; i < jobs_.size(); ++i) {
      if (i % static_cast<std::size_t>(shard.count) != static_cast<std::size_t>(shard.index)) continue;
      rows_[i] = args_.resume ? earlier(i) : std::nullopt;
      if (!rows_[i]) remaining.push_back(i);
    }
    num_remaining_ = remaining.size();
    const int threads = run_.options.threads > 0 ? run_.options.threads : tbb::this_task_arena::max_concurrency();
    std::atomic<std::size_t> next{0};
    tbb::parallel_for(
        0, threads,
        [&](int) {
          for (std::size_t at = next++; at < remaining.size(); at = next++)
            rows_[remaining[at]] = run_row(remaining[at]);
        },
        tbb::simple_partitioner());
  }

  /// Removes folders of rows that an earlier list had and this one has not.
  void remove_earlier_rows() const {
    std::set<std::string> current;
    for (std::size_t i = 0; i < jobs_.size(); ++i) current.insert(row_file(i).parent_path().filename().string());
    std::error_code error;
    std::vector<std::filesystem::path> stale;
    for (const auto& entry : std::filesystem::directory_iterator(run_.options.out / "rows", error)) {
      if (!current.contains(entry.path().filename().string()) &&
          std::filesystem::exists(entry.path() / "row.json", error))
        stale.push_back(entry.path());
    }
    for (const auto& folder : stale) std::filesystem::remove_all(folder, error);
  }

  [[nodiscard]] std::vector<BatchRow> rows() const {
    std::vector<BatchRow> done;
    for (const auto& row : rows_)
      if (row) done.push_back(*row);
    return done;
  }

 private:
  [[nodiscard]] std::filesystem::path row_file(std::size_t i) const {
    return run_.options.out / row_folder(i, jobs_[i].camera) / "row.json";
  }

  [[nodiscard]] std::optional<BatchRow> earlier(std::size_t i) const {
    std::error_code error;
    if (!std::filesystem::is_regular_file(row_file(i), error)) return std::nullopt;
    return parse_row(read_file(row_file(i)), jobs_[i].words);
  }

  [[nodiscard]] BatchRow run_row(std::size_t i) {
    const BatchJob& job = jobs_[i];
    BatchRow row{.camera = job.camera, .folder = row_folder(i, job.camera)};
    const std::filesystem::path folder = run_.options.out / row.folder;
    const auto begin = std::chrono::steady_clock::now();
    if (const std::string fault = job.fault.empty() ? fault_of(job.words) : job.fault; !fault.empty()) {
      row.exit_code = static_cast<int>(ExitCode::usage);
      row.state = "failed";
      row.sentence = fault;
    } else {
      run_command(job, folder, row);
    }
    row.seconds = std::chrono::duration<double>(std::chrono::steady_clock::now() - begin).count();
    write_file(folder / "row.json", row_text(row, job.words));
    report_progress(run_.progress, "rows", ++num_done_, num_remaining_);
    return row;
  }

  void run_command(const BatchJob& job, const std::filesystem::path& folder, BatchRow& row) {
    std::error_code error;
    std::filesystem::remove_all(folder, error);  // of an earlier run: a refusal would stand beside its estimate
    std::vector<std::string> words = job.words;
    words.insert(words.end(), {"--out", folder.string(), "--quiet"});
    if (!has_option(words, "--threads")) words.insert(words.end(), {"--threads", "1"});
    if (!args_.row_reports && !has_option(words, "--no-report")) words.emplace_back("--no-report");
    const ChildResult child = run_child(
        own_executable(), words, [this] { return !run_.progress || run_.progress("rows", num_done_, num_remaining_); });
    if (child.is_stopped) throw Interrupted();
    row.exit_code = child.exit_code;
    const bool has_result = child.exit_code == 0 || (child.exit_code >= 4 && child.exit_code <= 6);
    const std::filesystem::path result = folder / "result.json";
    if (has_result && std::filesystem::is_regular_file(result)) {
      read_result(read_file(result), result.string(), row);
    } else {
      row.sentence = last_line(child.errors);
      if (row.sentence.empty() && child.exit_code > 128)
        row.sentence = fmt::format("ended by signal {}", child.exit_code - 128);
    }
    if (row.state.empty()) row.state = child.exit_code == 0 ? "good" : "failed";
  }

  const BatchArgs& args_;
  std::vector<BatchJob> jobs_;
  Run& run_;
  std::vector<std::optional<BatchRow>> rows_;
  std::size_t num_remaining_ = 0;
  std::atomic<std::size_t> num_done_{0};
};

ExitCode run_batch(const BatchArgs& args, Run& run) {
  if (run.options.keeps_outcome) throw UsageError("a batch leaves its rows in a folder: run it as a command");
  const Shard shard = shard_from(args.shard.empty() ? shard_of_rank() : args.shard);
  run.add_input("jobs", args.jobs);
  Lot lot(args, read_jobs(args.jobs), run);
  run.lap("read");
  try {
    lot.work(shard);
  } catch (const Interrupted&) {
    const std::size_t done = lot.rows().size();
    if (done == 0) throw Interrupted("interrupted before a row was done: nothing is kept");
    throw Interrupted(fmt::format("interrupted; {} {} in {}: go on with --resume", done,
                                  done == 1 ? "row is" : "rows are", (run.options.out / "rows").string()));
  }
  run.lap("rows");
  lot.remove_earlier_rows();
  JobOutcome outcome = outcome_of(lot.rows());
  if (shard.count > 1) {
    // The last process, which requests all of them, makes the table.
    run.say(fmt::format("shard {}/{}: {} rows; the table of all: alidade batch {} --resume --out {}", shard.index,
                        shard.count, lot.rows().size(), args.jobs.string(), run.options.out.string()));
    return ExitCode::ok;
  }
  return run.finish(std::move(outcome));
}

}  // namespace

void add_batch(App& app) {
  auto args = std::make_shared<BatchArgs>();
  CLI::App& command = app.add_command(
      {.name = "batch",
       .summary = "Run many commands, one per row: one table of results, and the outliers among them",
       .examples =
           "  alidade batch jobs.csv --out lot\n"
           "  alidade batch jobs.csv --out lot --resume\n"
           "  mpirun -n 8 alidade batch jobs.csv --out lot && alidade batch jobs.csv --out lot --resume\n\n"
           "jobs.csv, one row per command; other columns are options by name:\n"
           "  camera,arguments,square\n"
           "  c0001,calibrate photos/c0001 --board 9x6,0.025\n\n"
           "Exit code: 0 if any row has an estimate, 4 if none has; the exit code of each row is in batch.csv, column\n"
           "exit_code, and rows without an estimate are named"},
      [args](Run& run) { return run_batch(*args, run); });
  command
      .add_option("jobs", args->jobs,
                  "CSV, one row per command: columns command or arguments, camera, and options by name")
      ->required()
      ->type_name("FILE.csv");
  command.add_flag("--resume", args->resume, "Run only rows that are new or have changed since an earlier run");
  command
      .add_option("--shard", args->shard,
                  "Run every N-th row, starting at row I (from 0); a final --resume writes the table")
      ->type_name("I/N");
  command.add_flag("--row-reports", args->row_reports, "Also write a report.html for each row");
}

}  // namespace alidade::cli
