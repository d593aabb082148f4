#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/public.h"
#include "alidade/rig/calibration.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Where heads can look, and where a board can stand.
struct ViewConfig {
  double min_pan_deg = -40.0, max_pan_deg = 40.0, min_tilt_deg = -15.0, max_tilt_deg = 30.0;
  double min_range_m = 0.5, max_range_m = 3.0;
  double max_tilt_of_board_deg = 30.0;
};

[[nodiscard]] FieldList fields_of(ViewConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(ViewConfig config);

/// σ of the cameras' relative pose (of one head: of its camera after a rotation), the worst over the angles at which
/// the heads can look.
struct RigSigma {
  double angle_rad = 0.0, length_m = 0.0;
};

/// A view to take next.
struct NextView {
  int head = 1;                  ///< Its id.
  Eigen::Vector2d pan_tilt_rad;  ///< What its encoders are to read.
  int board = 0;                 ///< The number of the board's position.
  bool is_new_position = false;  ///< The board is to be put elsewhere first.
  Rigid3 world_from_board;       ///< Its pose, actual or planned.
  Eigen::Vector2d centre_px;     ///< Where the centre of the board is then seen.
  Rigid3 cam_from_board;
  double gain = 0.0;  ///< ln of σ now over σ with it; of a new placement per view, of the three that it is worth.
};

/// The next view that a calibrated rig needs.
struct ViewPlan {
  RigSigma now;
  std::optional<NextView> next;  ///< None where no view can be proposed.
  RigSigma with_next;            ///< With it, at a new placement with three of it.
};

/// The view that lowers the uncertainty most, by the information matrix of heads and boards: of the boards where they
/// stand, or at a new placement, seen there three times. Throws ConfigError for an invalid config, or a rig that did
/// not converge. Fedorov 1972 (sequential design).
[[nodiscard]] ViewPlan plan_view(const RigCalibration& now, const ViewConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
