#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "alidade/calibrate/calibrate.h"
#include "alidade/calibrate/checks/error_modes.h"

namespace alidade {

/// How a board's print departs from its grid (longer along than across, rows not perpendicular to columns, a spacing
/// that changes over the print, quadratic: printers do all of this by a few hundredths of a percent), a lens from its
/// model (the next radial term, thin prism), rays from one point (an entrance pupil that moves with the angle, a tilted
/// plate), and photos from an instant (a rolling shutter, and the same motion in all of them).
struct ModelErrors {
  std::string text;         ///< The largest, with its size; empty where none is significant.
  std::string remedy;       ///< What to do where it is of the lens.
  bool is_of_lens = false;  ///< The largest is an error of the lens or of its rays, not of the print.
  bool is_proved = false;   ///< The largest, from 4σ: one clean set in 800 has such.
  double moves = 0.0;       ///< Of the lens by what is significant, in its stated σ along the direction moved.
  /// For the covariance of the lens: what is proved moves it by, and what is not by as much as is beyond the 2.5σ that
  /// chance shows of one of so many; and the ratio of the print's lengths where the photos separate it from fx / fy by
  /// less than the stated σ.
  Eigen::MatrixXd cov;
  std::vector<UnseenMode> unseen;  ///< Of an ordinary size: below 4σ where they move the lens by 5σ.
};

/// Score tests of them: what the residuals would gain from one more parameter, lens and poses following. σ is that of
/// the corners' noise or that of the photos' scatter, whichever is larger. Nothing for a camera behind a port, or
/// fewer than six photos. docs/maths/honest-sigma.md.
[[nodiscard]] ModelErrors model_errors(std::span<const BoardView> views, const CalibrateReport& report);

}  // namespace alidade
