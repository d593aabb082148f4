#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/rangefinder/report.h"

namespace alidade {

/// Origin and direction (and scale) of a rangefinder's beam in the camera frame, by maximum likelihood, with what is
/// wrong among the shots named. Needs no first guess and does not throw on bad data: the report says how it went.
/// `points_in_board` [m]: of the board of those shots that have corners; may be empty if none has.
/// Wang & Li, "Calibration method of laser range finder and camera in information fusion process", 2020, eq. (5)–(16),
/// corrected in docs/maths/rangefinder.md. Throws Interrupted.
[[nodiscard]] RangefinderReport calibrate_rangefinder(std::span<const Shot> shots,
                                                      std::span<const Eigen::Vector3d> points_in_board,
                                                      const Camera& camera, const RangefinderConfig& config,
                                                      const Progress& progress = {});

/// What was taken as given, and the effect of each on the estimate.
[[nodiscard]] std::vector<Assumption> rangefinder_assumptions(const RangefinderReport& report);

/// Whether the estimate depends on a scale of the readings, or of the board, that is not given. Then it is better
/// estimated: a board that is too large as a whole moves the origin by its own part only.
[[nodiscard]] bool wants_scale(const RangefinderReport& report, const RangefinderConfig& config);

/// The same of a lens' distortion that its file gives without σ: then it is better estimated, where boards determine
/// it.
[[nodiscard]] bool wants_distortion(const RangefinderReport& report, const Camera& camera,
                                    const RangefinderConfig& config);

/// Why shots that no beam explains may do so: with the ranges in another unit, each range a row before or after its
/// spot and board, or spots with u and v exchanged or mirrored, a beam explains them well. One sentence; empty where
/// neither is so, and where a beam explains them as they are, though they may not determine which.
[[nodiscard]] std::string cause_of_misfit(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                                          const Camera& camera, const RangefinderConfig& config);

/// The verdict on the estimate, or why there is none, what to add, and which other method could determine it.
[[nodiscard]] Verdict rangefinder_verdict(const RangefinderReport& report, std::span<const Shot> shots,
                                          const RangefinderConfig& config);

struct SolvedRangefinder {
  RangefinderReport report;
  Verdict verdict;           ///< Without what was assumed: heed_assumptions().
  RangefinderConfig config;  ///< As it was solved with.
  Camera camera;             ///< The same: with the distortion open where its file gives it without σ.
};
/// calibrate_rangefinder() with automatic next steps: the readings' scale is estimated too where the result depends on
/// one that is not given and the shots determine it, and where no beam explains the shots the cause is searched for.
[[nodiscard]] SolvedRangefinder solve_rangefinder(std::span<const Shot> shots,
                                                  std::span<const Eigen::Vector3d> points_in_board,
                                                  const Camera& camera, const RangefinderConfig& config,
                                                  const Progress& progress = {});

}  // namespace alidade
