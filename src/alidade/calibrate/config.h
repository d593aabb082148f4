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

/// Shape that the board may have: flat as printed; a bow (two parameters: out-of-plane parabolas along x and y);
/// free (every point moves in 3-D, rigid motion and scale fixed); given (points known from elsewhere, fixed); or
/// automatic: free where a shape estimated on one half of the photos fits the other half better than a flat one, else
/// flat. The solve treats automatic as flat; judge_calibration() decides.
enum class BoardShape { flat, bow, free, given, automatic };

/// Prior knowledge of a lens parameter: a normal distribution.
struct Prior {
  std::string name;  ///< Parameter name of the lens model: fx, cx, k3, …
  double value = 0.0;
  double sigma = 1.0;  ///< Infinite: `value` is an initial guess only.

  bool operator==(const Prior&) const = default;
};

/// Which corners with implausibly large residuals are rejected: automatic rejects them only if the corners have
/// covariances; corners without one are external measurements, checked as they are.
enum class OutlierRule { automatic, drop, keep };

/// What is known of a camera behind a flat port before its photos in water are taken.
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
  std::vector<std::string> fixed = {"skew"};  ///< Fixed parameters: at the value of their prior, else zero (k…, skew).
  std::vector<std::string> free = {};         ///< Estimated although fixed by default: skew.
  std::vector<Prior> priors = {};
  BoardShape board_shape = BoardShape::automatic;
  OutlierRule outliers = OutlierRule::automatic;  ///< Rejected corners are named in the report.
  double outlier_sigmas = 8.0;                    ///< Corners with residuals above this many robust σ are outliers.
  int max_iterations = 60;
  PortKnowledge port = {};                         ///< For model flat_port.
  std::vector<Eigen::Vector3d> board_points = {};  ///< [m] For BoardShape::given: the board as known from elsewhere.
};

/// The words of the shapes that can be requested by name.
[[nodiscard]] const WordList<BoardShape>& shape_words();

/// The fields of `config` that a user sets: model, fix, free, prior, gap_m, glass_m, n_glass, n_water, board_shape
/// and outliers. The lens in air and the board points come from files.
[[nodiscard]] FieldList fields_of(CalibrateConfig& config);

ALIDADE_PUBLIC_END
}  // namespace alidade
