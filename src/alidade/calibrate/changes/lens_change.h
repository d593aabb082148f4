#pragma once

#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/view_scores.h"
#include "alidade/estimation/verdict.h"

namespace alidade {

/// How the lens changes over the photos: in their order, as for a lens that warms up, an autofocus that creeps, a bump;
/// or with the inverse distance of the board, as for an autofocus that was left on.
struct LensChange {
  enum class Profile { drift, jump, distance };
  static constexpr std::string_view focal_length = "focal length";
  Profile profile = Profile::drift;
  std::string what;           ///< focal_length, "cx" or "cy".
  double size = 0.0;          ///< First to last photo, or farthest to nearest board: relative for the focal
                              ///< length, else [px].
  double sigma = 0.0;         ///< From the scatter of the photos.
  std::size_t at = 0;         ///< For a jump: index of the first used view after it.
  double moves = 0.0;         ///< Deviation of the worst photo from the stated lens, in σ of a parameter.
  Eigen::VectorXd direction;  ///< Change of all lens parameters per unit.
  bool is_proved = false;
  double share_beyond_chance = 0.0;  ///< Part of the squared size that exceeds chance.
  double mean_square = 0.0;    ///< Mean square deviation of the photos from the stated lens; with distance, of far
                               ///< points. If it is not proved, of the part beyond chance.
  std::vector<double> course;  ///< Per view, relative to the mean, in units of `size`.
  double nearest_m = 0.0, farthest_m = 0.0;  ///< Distances of the boards.
};

/// What is known about a change.
struct LensChangeStudy {
  /// Relative drift of the focal length over the photos that would be proved in 99 of 100 such sets. None if
  /// too few photos determine it.
  std::optional<double> seen_from;
  std::optional<double> seen_by_distance;  ///< The same, from the farthest board to the nearest.
  std::optional<LensChange> change;
  std::vector<LensChange> rivals;  ///< Alternative changes, the most likely first.
};

/// The largest change of focal length, cx or cy over the photos: score tests of a drift and of a jump, and for the
/// focal length also of a dependence on the board's inverse distance; by the noise of the corners or the scatter of the
/// photos, whichever is larger, and only if not more than one in fifty random orders of the photos shows as much:
/// errors of the lens model are the same in all orders. A change of the focal length that is not proved is stated from
/// 2σ for a drift, 2.5σ with distance, 3.5σ for a jump (Student's distribution of the photos' scatter); what exceeds
/// that is included in σ. `views`: in the order taken. docs/maths/honest-sigma.md.
[[nodiscard]] LensChangeStudy lens_change(std::span<const ViewScore> views, const CalibrateReport& report);

/// Fixes all but focal length and centre at the estimate from all photos: parts of them do not determine distortion.
[[nodiscard]] CalibrateConfig with_distortion_fixed(CalibrateConfig config, const CalibrateReport& report);

/// Whether the views before and after it, or near and far, calibrated separately, differ by as much, within 3σ: if lens
/// or board violate the model, scores prove nothing. `used`: the used views, in the order taken.
[[nodiscard]] bool is_confirmed(const LensChange& change, const Board& board, std::span<const BoardView> used,
                                const CalibrateConfig& config, const CalibrateReport& report);

/// Includes in the σ of the estimate that the lens of a photo deviates from the stated one.
void count_change(const LensChange& change, CalibrateReport& report);

/// Adds the check "same lens" to the verdict: `care` if a change is proved and photos deviate from the stated lens
/// by more than two of its σ. `photos`: the names of the used ones, in the
/// order taken.
void heed_change(const LensChangeStudy& study, std::span<const std::string> photos, Verdict& verdict);

}  // namespace alidade
