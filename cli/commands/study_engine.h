#pragma once

#include <functional>

#include "alidade/study/study_plan.h"

namespace alidade::cli {

/// Who runs the blocks of a study: threads of this process, or (in alidade-study) the ranks of an MPI job.
struct StudyEngine {
  std::function<void(const StudyPlan& plan, const std::vector<TrialBlock>& blocks, const BlockDone& done,
                     const Progress& progress)>
      run = run_blocks;
  /// Of a rank that only works: takes blocks until there are no more. It reads and writes nothing.
  std::function<void(const StudyPlan& plan)> serve = {};
};
[[nodiscard]] StudyEngine& study_engine();

}  // namespace alidade::cli
