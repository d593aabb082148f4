#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/camera/camera.h"
#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Which shape the board may have: flat as printed; a bow (two parameters: out-of-plane parabolas along x and y);
/// free (every point moves in 3-D, rigid motion and scale fixed); given (points known from elsewhere, fixed); or
/// automatic: free where a shape estimated on one half of the photos fits the other half better than a flat one, flat
/// elsewhere. calibrate() takes automatic as flat; judge_calibration() decides.
enum class BoardShape { flat, bow, free, given, automatic };

/// What is known of a lens parameter before the photos: a normal distribution.
struct Prior {
  std::string name;  ///< Parameter name of the lens model: fx, cx, k3, …
  double value = 0.0;
  double sigma = 1.0;  ///< Infinite: an initial guess only.

  bool operator==(const Prior&) const = default;
};

/// Which corners that no noise explains are rejected: automatic rejects them where corners come with a covariance;
/// corners without one are external measurements, checked as they are.
enum class OutlierRule { automatic, drop, keep };

/// What is known of a camera behind a flat port before its photos in water.
struct PortKnowledge {
  std::optional<Camera>
      air;              ///< The lens as calibrated in air (pinhole or brown), fixed. None: it is estimated as well.
  double gap_m = 0.02;  ///< Initial guess.
  std::optional<double> glass_m;         ///< Fixed; must be given.
  double n_glass = 1.5, n_water = 1.34;  ///< Fixed: the photos hardly separate them from the gap.
};

/// Options of calibrate(). Plain data with usable defaults: `calibrate(photos, board)` is a sensible call.
struct CalibrateConfig {
  std::string model = "brown";                ///< pinhole, brown, kannala_brandt or flat_port.
  std::vector<std::string> fixed = {"skew"};  ///< Fixed parameters: at their prior's value, else zero (k…, skew).
  std::vector<std::string> free = {};         ///< Parameters estimated that are fixed by default: skew.
  std::vector<Prior> priors = {};
  BoardShape board_shape = BoardShape::automatic;
  OutlierRule outliers = OutlierRule::automatic;  ///< Rejected corners are named.
  double outlier_sigmas = 8.0;                    ///< A corner further off than this many robust σ is an outlier.
  int max_iterations = 60;
  PortKnowledge port = {};                         ///< Of model flat_port.
  std::vector<Eigen::Vector3d> board_points = {};  ///< [m] Of BoardShape::given: the board as known from elsewhere.
};

/// The words of the shapes that can be requested by name.
[[nodiscard]] const WordList<BoardShape>& shape_words();

/// The fields of `config` that a user sets: model, fix, free, prior, gap_m, glass_m, n_glass, n_water, board_shape
/// and outliers. Lens in air and board points are values that come from files.
[[nodiscard]] FieldList fields_of(CalibrateConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
