#pragma once

#include <filesystem>
#include <span>

#include "alidade/board/board.h"
#include "alidade/rangefinder/next_shot.h"
#include "alidade/rangefinder/rangefinder.h"
#include "alidade/rangefinder/shot_checks.h"
#include "alidade/results/result_document.h"

namespace alidade {

/// What a run of `rangefinder` puts into its document beside the report itself.
struct RangefinderExtras {
  std::optional<Board> board;
  std::vector<ShotGain> gains;         ///< Of the next shot.
  std::vector<CountedSigma> by_count;  ///< σ against the number of shots.
  std::vector<LeftOutShot> left_out;   ///< Each shot predicted by the others; empty: not done.
};

/// Fills in counts, estimate, stddev, covariance, and the tables shots, planes, by_count and the grid next_shot.
void fill_rangefinder(std::span<const Shot> shots, const RangefinderReport& report, const RangefinderConfig& config,
                      const RangefinderExtras& extras, ResultDocument& document);

/// What `plan rangefinder` needs of the folder (or result.json) of a calibrated rangefinder. Throws InputError: not
/// such a result, or a refused one that leaves no beam.
[[nodiscard]] BeamNow read_rangefinder(const std::filesystem::path& result);

}  // namespace alidade
