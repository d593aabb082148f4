#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <atomic>
#include <mutex>

#include "alidade/study/study_plan.h"

namespace alidade {

StudyTally BlockWorker::run(const TrialBlock& block, const Progress& progress) {
  const auto point = static_cast<std::size_t>(block.first / plan_.header.trials);
  const std::uint64_t first_of_point = point * plan_.header.trials;
  RunTrial& run_trial = workers_[point];
  if (!run_trial) run_trial = plan_.points[point].make_worker();
  StudyTally tally(plan_.header.quantities.size());
  for (std::uint64_t at = block.first; at < block.end; ++at) {
    result_.state = State::refused;
    result_.has_estimate = false;
    result_.values.clear();
    run_trial(at - first_of_point, result_);
    tally.add(at - first_of_point, result_);
    report_progress(progress, "trials", at + 1 - block.first, block.end - block.first);
  }
  return tally;
}

void run_blocks(const StudyPlan& plan, const std::vector<TrialBlock>& blocks, const BlockDone& done,
                const Progress& progress) {
  std::size_t total = 0;
  for (const TrialBlock& block : blocks) total += block.end - block.first;
  std::atomic<std::size_t> next{0}, trials{0};
  std::mutex mutex;
  const auto work = [&](int) {
    // Estimators that use threads find none but this one: what they compute is the same however many there are.
    tbb::task_arena alone(1);
    BlockWorker worker(plan);
    const Progress tell = [&](std::string_view what, std::size_t, std::size_t) {
      return !progress || progress(what, ++trials, total);
    };
    for (std::size_t i = next++; i < blocks.size(); i = next++) {
      StudyTally tally;
      alone.execute([&] { tally = worker.run(blocks[i], tell); });
      const std::scoped_lock lock(mutex);
      done(blocks[i], tally);
    }
  };
  const int threads =
      std::min(tbb::this_task_arena::max_concurrency(), static_cast<int>(std::min<std::size_t>(blocks.size(), 1024)));
  tbb::parallel_for(0, threads, work, tbb::simple_partitioner());
}

}  // namespace alidade
