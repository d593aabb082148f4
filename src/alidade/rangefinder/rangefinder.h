#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/progress.h"
#include "alidade/estimation/verdict.h"
#include "alidade/rangefinder/report.h"

namespace alidade {

/// Maximum-likelihood origin and direction (and scale) of a rangefinder's beam in the camera frame, with a report of
/// faulty shots. Needs no initial guess and does not throw because of bad data: see the status of the report.
/// `points_in_board` [m]: the board of the shots with corners; may be empty if there are none.
/// Wang & Li, "Calibration method of laser range finder and camera in information fusion process", 2020, eq. (5)–(16),
/// corrected in docs/maths/rangefinder.md. Throws Interrupted.
[[nodiscard]] RangefinderReport calibrate_rangefinder(std::span<const Shot> shots,
                                                      std::span<const Eigen::Vector3d> points_in_board,
                                                      const Camera& camera, const RangefinderConfig& config,
                                                      const Progress& progress = {});

/// What was assumed, and the effect of each assumption on the estimate.
[[nodiscard]] std::vector<Assumption> rangefinder_assumptions(const RangefinderReport& report);

/// Whether the estimate depends on a scale of the readings, or of the board, that is not given. It is then better
/// estimated: a board that is too large by some percentage then changes the origin by that percentage only.
[[nodiscard]] bool wants_scale(const RangefinderReport& report, const RangefinderConfig& config);

/// The same for a lens distortion that the file gives without σ: it is then better estimated, if boards determine
/// it.
[[nodiscard]] bool wants_distortion(const RangefinderReport& report, const Camera& camera,
                                    const RangefinderConfig& config);

/// Possible reason why no beam explains the shots: with the ranges in another unit, the ranges shifted by a row against
/// spots and boards, or spots with u and v exchanged or mirrored, a beam fits them well. One sentence; empty if none of
/// these helps. If the shots were solved for (`is_solved`), or a beam fits them with a scatter of some centimetres, the
/// unit is right, and another cause is named only if a beam then fits all shots far better.
[[nodiscard]] std::string cause_of_misfit(std::span<const Shot> shots, std::span<const Eigen::Vector3d> points_in_board,
                                          const Camera& camera, const RangefinderConfig& config, bool is_solved);

/// The verdict on the estimate; or why there is none, what to add, and which other method could determine it.
[[nodiscard]] Verdict rangefinder_verdict(const RangefinderReport& report, std::span<const Shot> shots,
                                          const RangefinderConfig& config);

struct SolvedRangefinder {
  RangefinderReport report;
  Verdict verdict;           ///< Without the assumptions: heed_assumptions().
  RangefinderConfig config;  ///< As used in the solve.
  Camera camera;             ///< As used: with the distortion free where its file gives it without σ.
};
/// calibrate_rangefinder() with automatic follow-ups: the scale of the readings is estimated too if the result depends
/// on one that is not given and the shots determine it; if no beam explains the shots, the cause is searched for.
[[nodiscard]] SolvedRangefinder solve_rangefinder(std::span<const Shot> shots,
                                                  std::span<const Eigen::Vector3d> points_in_board,
                                                  const Camera& camera, const RangefinderConfig& config,
                                                  const Progress& progress = {});

}  // namespace alidade
