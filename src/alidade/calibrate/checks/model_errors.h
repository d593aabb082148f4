#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/error_modes.h"

namespace alidade {

/// How a board's print deviates from its grid (longer along than across, rows not perpendicular to columns, a spacing
/// that changes over the print, quadratic: printers do all of this by a few hundredths of a percent), a lens from its
/// model (the next radial term, thin prism), rays from a common point (an entrance pupil that moves with the angle, a
/// tilted plate), and photos from an instant (a rolling shutter, with the same motion in all of them).
struct ModelErrors {
  std::string text;         ///< The largest one, with its size; empty if none is significant.
  std::string remedy;       ///< What to do if it is an error of the lens.
  bool is_of_lens = false;  ///< The largest is an error of the lens or of its rays, not of the print.
  bool is_proved = false;   ///< The largest exceeds 4σ: one clean set in 800 has such a one.
  double moves = 0.0;       ///< Shift of the lens by what is significant, in its stated σ along that shift.
  /// Added to the covariance of the lens: the shift by what is significant, and for the rest the excess over the 2.5σ
  /// that one of so many shows by chance; and the aspect ratio of the print where the photos separate it from fx / fy
  /// by less than the stated σ.
  Eigen::MatrixXd cov;
  std::vector<UnseenMode> unseen;  ///< Modes of typical size that are below 4σ where they move the lens by 5σ.
};

/// Score tests of these: the gain in the residuals from one more parameter, lens and poses following. σ is from
/// the corners' noise or the photos' scatter, whichever is larger. Empty for a camera behind a port, or
/// fewer than six photos. docs/maths/honest-sigma.md.
[[nodiscard]] ModelErrors model_errors(std::span<const BoardView> views, const CalibrateReport& report);

}  // namespace alidade
