#pragma once

#include <string>
#include <vector>

namespace alidade {

/// Which shape the board may have: flat as printed; a bow (two parameters: out-of-plane parabolas along x and y);
/// free (every point moves in 3-D, rigid motion and scale held); given (points learned elsewhere, held); or automatic:
/// free where a shape learned on one half of the photos fits the other half better than a flat one, flat elsewhere.
/// calibrate() takes automatic as flat; judge_calibration() decides.
enum class BoardShape { flat, bow, free, given, automatic };

/// What is known of a lens parameter before the photos: a normal distribution.
struct Prior {
  std::string name;  ///< Parameter name of the lens model: fx, cx, k3, …
  double value = 0.0;
  double sigma = 1.0;  ///< Infinite: a start, no knowledge.

  bool operator==(const Prior&) const = default;
};

/// Options of calibrate(). Plain data with usable defaults: `calibrate(board, views, size, {})` is a sensible call.
struct CalibrateConfig {
  std::string model = "brown";                ///< pinhole, brown, kannala_brandt or flat_port.
  std::vector<std::string> fixed = {"skew"};  ///< Parameters held: at their prior's value, else zero (k…, skew).
  std::vector<Prior> priors = {};
  BoardShape board_shape = BoardShape::flat;
  bool reject_outliers = true;  ///< Drop, and name, corners that no noise explains.
  double outlier_sigmas = 8.0;  ///< A corner further off than this many robust σ is an outlier.
  int max_iterations = 60;

  bool operator==(const CalibrateConfig&) const = default;
};

}  // namespace alidade
