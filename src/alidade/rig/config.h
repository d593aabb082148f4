#pragma once

#include <optional>
#include <string>
#include <vector>

#include "alidade/board/board.h"
#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Options of rig(). Plain data; the board must be given.
struct RigConfig {
  std::optional<double> sigma_px = {};           ///< σ of a corner coordinate; none: estimated from the residuals.
  std::optional<double> sigma_encoder_rad = {};  ///< σ of a reading; none: estimated from the residuals.
  std::optional<Board> board = {};               ///< It must not move while the heads observe it.
  bool estimate_scales = false;                  ///< Scale: axis angle per radian read.
  bool estimate_once = false;                    ///< Encoder error with one period per revolution, each axis.
  bool estimate_backlash = false;                ///< Requires the views in the order in which they were taken.
  bool estimate_focal = false;                   ///< One factor per lens for fx and fy; the file is the initial guess.
  bool estimate_centre = false;
  /// Also estimates causes that the residuals indicate, if the views determine them, and scales that are not
  /// given.
  bool estimate_by_need = true;
  std::optional<double> sigma_square_m = {};  ///< σ of the side of the board's squares; none: unknown.
  std::optional<double> sigma_scale = {};     ///< σ of the encoders' scales where they are fixed; none: unknown.
  /// σ of an encoder's error within a revolution, which changes its scale over part of the revolution: added to
  /// sigma_scale. 0: no such error.
  double sigma_within_turn_rad = 5e-4;
  bool estimate_skew = true;  ///< Deviation of the axes from perpendicularity.
  bool reject_outliers = true;
};

/// The fields of `config` that a user sets: sigma_px, sigma_angle_rad, sigma_square_m, sigma_scale,
/// sigma_within_turn_rad, estimate, scales,
/// outliers. The board has its own fields.
[[nodiscard]] FieldList fields_of(RigConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(RigConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
