// alidade-study: `alidade study …` whose blocks of trials the ranks of an MPI job share. An executable of its own, as
// MPI costs its start.
#include <mpi.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <exception>
#include <iostream>
#include <mutex>
#include <string>
#include <thread>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/results/documents/study_blocks.h"
#include "cli/app/app.h"
#include "cli/commands/commands.h"
#include "cli/commands/study_engine.h"

namespace alidade::cli {
namespace {

// What ranks say to each other: a worker its tally of the block it had (nothing at first), rank 0 the next block.
constexpr int tally_tag = 1, block_tag = 2;
constexpr auto poll_every = std::chrono::milliseconds(1);  // a block takes some hundred times as long

/// Waits without using the core that other ranks compute on.
void receive_ready(int source, int tag, MPI_Status& status) {
  for (int is_there = 0; is_there == 0;) {
    MPI_Iprobe(source, tag, MPI_COMM_WORLD, &is_there, &status);
    if (is_there == 0) std::this_thread::sleep_for(poll_every);
  }
}

std::string receive_text(const MPI_Status& status) {
  int size = 0;
  MPI_Get_count(&status, MPI_CHAR, &size);
  std::string text(static_cast<std::size_t>(size), '\0');
  MPI_Recv(text.data(), size, MPI_CHAR, status.MPI_SOURCE, tally_tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
  return text;
}

void send_block(int rank, const TrialBlock& block) {
  const unsigned long long ends[2] = {block.first, block.end};
  MPI_Send(ends, 2, MPI_UNSIGNED_LONG_LONG, rank, block_tag, MPI_COMM_WORLD);
}

/// No block: there are no more.
constexpr TrialBlock no_more{0, 0};

/// Of a rank that works: block after block, until there are no more.
void serve(const StudyPlan& plan) {
  BlockWorker worker(plan);
  std::string tally;
  while (true) {
    MPI_Send(tally.data(), static_cast<int>(tally.size()), MPI_CHAR, 0, tally_tag, MPI_COMM_WORLD);
    MPI_Status status;
    receive_ready(0, block_tag, status);
    unsigned long long ends[2] = {0, 0};
    MPI_Recv(ends, 2, MPI_UNSIGNED_LONG_LONG, 0, block_tag, MPI_COMM_WORLD, MPI_STATUS_IGNORE);
    if (ends[0] == ends[1]) return;
    tally = tally_text(worker.run({ends[0], ends[1]}));
  }
}

/// Deals blocks to the other ranks, one at a time to each, and computes some itself in a second thread.
class Dealer {
 public:
  Dealer(const StudyPlan& plan, const std::vector<TrialBlock>& blocks, BlockDone done, const Progress& progress)
      : plan_(plan), blocks_(blocks), done_(std::move(done)), progress_(progress) {
    for (const TrialBlock& block : blocks) total_ += block.end - block.first;
    MPI_Comm_size(MPI_COMM_WORLD, &num_ranks_);
    held_.resize(static_cast<std::size_t>(num_ranks_), no_more);
  }

  void run() {
    std::exception_ptr fault;
    std::thread own([&] {
      try {
        compute();
      } catch (...) {
        fault = std::current_exception();
        is_stopped_ = true;
      }
    });
    try {
      deal();
    } catch (...) {
      is_stopped_ = true;
      own.join();
      throw;
    }
    own.join();
    if (fault) std::rethrow_exception(fault);
  }

 private:
  [[nodiscard]] TrialBlock next() {
    const std::size_t i = next_++;
    return i < blocks_.size() && !is_stopped_ ? blocks_[i] : no_more;
  }

  void finish(const TrialBlock& block, const StudyTally& tally) {
    const std::scoped_lock lock(mutex_);
    done_(block, tally);
    num_done_ += block.end - block.first;
  }

  void compute() {
    BlockWorker worker(plan_);
    const Progress ask = [this](std::string_view, std::size_t, std::size_t) { return !is_stopped_.load(); };
    for (TrialBlock block = next(); block != no_more; block = next()) finish(block, worker.run(block, ask));
  }

  /// Until every rank knows that there are no more.
  void deal() {
    for (int left = num_ranks_ - 1; left > 0 || next_ < blocks_.size();) {
      if (progress_ && !progress_("trials", num_done_, total_)) is_stopped_ = true;
      if (is_stopped_) throw Interrupted();
      int is_there = 0;
      MPI_Status status;
      MPI_Iprobe(MPI_ANY_SOURCE, tally_tag, MPI_COMM_WORLD, &is_there, &status);
      if (is_there == 0) {
        std::this_thread::sleep_for(poll_every);
        continue;
      }
      const int rank = status.MPI_SOURCE;
      TrialBlock& held = held_[static_cast<std::size_t>(rank)];
      const std::string text = receive_text(status);
      const TrialBlock given = next();
      send_block(rank, given);  // first, so that it need not wait for the disk
      if (held != no_more) finish(held, parse_tally(text, "rank " + std::to_string(rank)));
      held = given;
      if (given == no_more) --left;
    }
  }

  const StudyPlan& plan_;
  const std::vector<TrialBlock>& blocks_;
  BlockDone done_;
  const Progress& progress_;
  int num_ranks_ = 1;
  std::size_t total_ = 0;
  std::atomic<std::size_t> next_{0}, num_done_{0};
  std::atomic<bool> is_stopped_{false};
  std::mutex mutex_;
  std::vector<TrialBlock> held_;  ///< By rank.
};

/// `alidade-study observe …` is `alidade study observe …`.
std::vector<std::string> words_of(int argc, char** argv) {
  std::vector<std::string> words(argv + 1, argv + argc);
  const bool is_about_program = !words.empty() && (words[0] == "--version" || words[0] == "--help" || words[0] == "-h");
  if (!is_about_program && (words.empty() || words[0] != "study")) words.insert(words.begin(), "study");
  return words;
}

int run_words(const std::vector<std::string>& words) {
  std::vector<const char*> argv{"alidade-study"};
  for (const std::string& word : words) argv.push_back(word.c_str());
  const int code = run_cli(static_cast<int>(argv.size()), argv.data(), add_study);
  std::cout.flush();
  return code;
}

/// Rank 0: the command as anybody runs it.
int lead(const std::vector<std::string>& words) {
  study_engine().run = [](const StudyPlan& plan, const std::vector<TrialBlock>& blocks, const BlockDone& done,
                          const Progress& progress) { Dealer(plan, blocks, done, progress).run(); };
  return run_words(words);
}

/// Another rank. What is wrong with the line rank 0 says.
int follow(const std::vector<std::string>& words) {
  bool has_served = false;
  study_engine().serve = [&](const StudyPlan& plan) {
    serve(plan);
    has_served = true;
  };
  try {
    App app;
    add_study(app);
    (void)app.run_job(words, {});
    return 0;
  } catch (const std::exception&) {
    if (has_served) throw;
    return 2;
  }
}

}  // namespace
}  // namespace alidade::cli

int main(int argc, char** argv) {
  // Ranks that wait give way: on a busy machine a block is dealt in microseconds, not in milliseconds.
  setenv("OMPI_MCA_mpi_yield_when_idle", "1", 0);
  int level = 0, rank = 0, size = 1;
  MPI_Init_thread(&argc, &argv, MPI_THREAD_FUNNELED, &level);
  MPI_Comm_rank(MPI_COMM_WORLD, &rank);
  MPI_Comm_size(MPI_COMM_WORLD, &size);
  const std::vector<std::string> words = alidade::cli::words_of(argc, argv);
  int code = 1;
  if (rank == 0) {
    // Alone it is the command: threads share the work.
    if (size == 1) {
      code = alidade::cli::run_words(words);
    } else {
      code = alidade::cli::lead(words);
    }
  } else {
    try {
      code = alidade::cli::follow(words);
    } catch (const std::exception& error) {
      std::cerr << "alidade-study: rank " << rank << ": " << error.what() << "\n";
      MPI_Abort(MPI_COMM_WORLD, 1);
    }
  }
  // Where rank 0 stopped early others still wait for blocks, or work on one: the job ends as a whole. Wrong usage all
  // have seen.
  if (rank == 0 && size > 1 && code != 0 && code != 2 && code != 4 && code != 6) MPI_Abort(MPI_COMM_WORLD, code);
  MPI_Finalize();
  return code;
}
