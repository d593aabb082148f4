#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// Views of two lenses mixed together: of two cameras, two zooms, or of images that were cropped or scaled.
struct TwoLenses {
  Camera first, second;                      ///< Each from its own views; the first has more of them.
  std::vector<std::size_t> seconds;          ///< Indices of the second camera's views.
  double apart_px = 0.0, together_px = 0.0;  ///< shared_noise_px() with two cameras, and with one for all.
};

/// True for the views above the split that leaves the least scatter in both parts, ordered by the change of the lens
/// along `direction` that each indicates.
[[nodiscard]] std::vector<bool> divided_along(std::span<const ViewScore> scores, const Eigen::VectorXd& direction);

/// Splits the views in two so that each part fits its own lens: they are ordered by the focal length (or cx, cy) that
/// each indicates relative to the common lens, split where the remaining scatter is smallest, then calibrated and
/// reassigned to the better-fitting lens until convergence. None if the photos of a part disagree nearly as much as
/// all, as for a lens that changes gradually. `views`: the used ones, complete; `scores`: theirs.
[[nodiscard]] std::optional<TwoLenses> two_lenses(const Board& board, std::span<const BoardView> views,
                                                  std::span<const ViewScore> scores, CalibrateConfig config,
                                                  const CalibrateReport& report);

/// Reports them in the verdict, which is State::bad: the stated lens is that of no view. `photos`: of the views.
void heed_two_lenses(const TwoLenses& found, std::span<const std::string> photos, Verdict& verdict);

}  // namespace alidade
