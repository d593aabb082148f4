#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/public.h"
#include "alidade/rig/calibration.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Where heads can point, and where a board can be placed.
struct ViewConfig {
  double min_pan_deg = -40.0, max_pan_deg = 40.0, min_tilt_deg = -15.0, max_tilt_deg = 30.0;
  double min_range_m = 0.5, max_range_m = 3.0;
  double max_tilt_of_board_deg = 30.0;
};

[[nodiscard]] FieldList fields_of(ViewConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(ViewConfig config);

/// σ of the relative pose of the cameras (one head: of its camera after a rotation), the worst over the angles at
/// which the heads can point.
struct RigSigma {
  double angle_rad = 0.0, length_m = 0.0;
};

/// A view to take next.
struct NextView {
  int head = 1;                  ///< Its id.
  Eigen::Vector2d pan_tilt_rad;  ///< Encoder readings to move to.
  int board = 0;                 ///< Number of the board's pose.
  bool is_new_position = false;  ///< The board must first be moved to a new place.
  Rigid3 world_from_board;       ///< Its pose: estimated, or planned if it is new.
  Eigen::Vector2d centre_px;     ///< Pixel of the board's centre in that view.
  Rigid3 cam_from_board;
  double gain = 0.0;  ///< ln(σ now / σ with it) per view; a new placement is evaluated with three views.
};

/// The next view that a calibrated rig needs.
struct ViewPlan {
  RigSigma now;
  std::optional<NextView> next;  ///< None where no view can be proposed.
  RigSigma with_next;            ///< Including it; a new placement with all three of its views.
};

/// The view that lowers the uncertainty most, by the information matrix of heads and boards: of a board where it
/// stands, or at a new placement with three views of it. Throws ConfigError for an invalid config, or a rig that did
/// not converge. Fedorov 1972 (sequential design).
[[nodiscard]] ViewPlan plan_view(const RigCalibration& now, const ViewConfig& config = {});

ALIDADE_PUBLIC_END
}  // namespace alidade
