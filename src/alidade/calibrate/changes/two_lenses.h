#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Views of two lenses among each other: of two cameras, two zooms, or of images that were cropped or scaled.
struct TwoLenses {
  Camera first, second;                      ///< Each by its own views; the first has more of them.
  std::vector<std::size_t> seconds;          ///< Positions of the second's views.
  double apart_px = 0.0, together_px = 0.0;  ///< shared_noise_px() of each with its own, and of all with one.
};

/// The views divided in two so that each part fits a lens of its own: they are ordered by what each says of the focal
/// length (or of cx, cy) beside the lens of all, divided where that leaves least scatter, then calibrated and divided
/// anew by which lens fits each, until that settles. None where the photos of a part disagree nearly as much as all, as
/// of a lens that changes evenly. `views`: those in use, whole; `scores`: theirs.
[[nodiscard]] std::optional<TwoLenses> two_lenses(const Board& board, std::span<const BoardView> views,
                                                  std::span<const ViewScore> scores, CalibrateConfig config,
                                                  const CalibrateReport& report);

/// Names them in the verdict, which is State::bad: the stated lens is that of no view. `photos`: of the views.
void heed_two_lenses(const TwoLenses& found, std::span<const std::string> photos, Verdict& verdict);

}  // namespace alidade
