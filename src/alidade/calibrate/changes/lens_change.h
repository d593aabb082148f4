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

/// How the lens changes over the photos: in their order, as a lens that warms up, an autofocus that creeps, a bump; or
/// with the inverse distance of the board, as an autofocus that is left on.
struct LensChange {
  enum class Profile { drift, jump, distance };
  static constexpr std::string_view focal_length = "focal length";
  Profile profile = Profile::drift;
  std::string what;           ///< focal_length, "cx" or "cy".
  double size = 0.0;          ///< From the first photo to the last, or the farthest to the nearest board; of the focal
                              ///< length relative, else [px].
  double sigma = 0.0;         ///< Of it, by the scatter of the photos.
  std::size_t at = 0;         ///< Of a jump: the first view after it, among those in use.
  double moves = 0.0;         ///< Of the photo that is farthest from the stated lens, in σ of a parameter.
  Eigen::VectorXd direction;  ///< Of all lens parameters, for a change of one.
  bool is_proved = false;
  double share_beyond_chance = 0.0;  ///< Of the size's square, what chance does not show.
  double mean_square = 0.0;          ///< Of the photos' departures from the stated lens; by distance, of far points.
                                     ///< Where it is not proved, of the share beyond chance.
  std::vector<double> course;        ///< Of each view, about the mean, in units of `size`.
  double nearest_m = 0.0, farthest_m = 0.0;  ///< Boards.
};

/// What is known of a change.
struct LensChangeStudy {
  /// Drift of the focal length over the photos, relative, that would be proved in 99 of 100 sets like this. None where
  /// too few photos determine it.
  std::optional<double> seen_from;
  std::optional<double> seen_by_distance;  ///< From the farthest board to the nearest.
  std::optional<LensChange> change;
  std::vector<LensChange> rivals;  ///< Others that would be stated in its stead, the likeliest first.
};

/// The largest change of focal length, cx or cy over the photos: a score test of a drift and of a jump, of the focal
/// length also with the board's inverse distance, by the noise
/// of the corners and by the scatter of the photos, whichever is larger, which not more than one in fifty orders of the
/// same photos shows as well: what the lens model does not explain is in all orders alike. A change of the focal length
/// that is not proved is stated from 2σ of a drift, 2.5σ with the distance, 3.5σ of a jump (of Student's distribution
/// by the photos' scatter); what is beyond is included in σ. `views`: in the order taken. docs/maths/honest-sigma.md.
[[nodiscard]] LensChangeStudy lens_change(std::span<const ViewScore> views, const CalibrateReport& report);

/// Everything but focal length and centre as all photos gave it: parts of them do not determine a lens' distortion.
[[nodiscard]] CalibrateConfig with_distortion_fixed(CalibrateConfig config, const CalibrateReport& report);

/// Whether the views before and after it, or near and far, calibrated apart, differ by as much, within 3σ: where lens
/// or board are not as they are modelled, scores are not proof. `used`: the views in use, in the order taken.
[[nodiscard]] bool is_confirmed(const LensChange& change, const Board& board, std::span<const BoardView> used,
                                const CalibrateConfig& config, const CalibrateReport& report);

/// Includes in σ of what was estimated that the lens of a photo departs from the stated one.
void count_change(const LensChange& change, CalibrateReport& report);

/// Adds the check "same lens" to the verdict. Of care where a change is proved and photos depart from the stated lens
/// by more than two of its σ. `photos`: the names of those in use, in the
/// order taken.
void heed_change(const LensChangeStudy& study, std::span<const std::string> photos, Verdict& verdict);

}  // namespace alidade
