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
  std::optional<double> sigma_px = {};           ///< Of a corner's coordinate; none: estimated from the residuals.
  std::optional<double> sigma_encoder_rad = {};  ///< Of a reading; none: estimated from the residuals.
  std::optional<Board> board = {};               ///< Static while the heads observed it.
  bool estimate_scales = false;                  ///< Radians of the axes for each radian read.
  bool estimate_once = false;                    ///< An error of one period per revolution of each axis.
  bool estimate_backlash = false;                ///< Views stand in the order in which they were taken.
  bool estimate_focal = false;                   ///< Of each lens, both by one factor; its file is an initial guess.
  bool estimate_centre = false;
  /// Causes indicated by the residuals are estimated too, where the views determine them; and scales that are not
  /// given.
  bool estimate_by_need = true;
  std::optional<double> sigma_square_m = {};  ///< Of the board's squares; none: not known.
  std::optional<double> sigma_scale = {};     ///< Of the encoders' scales where they are fixed; none: not known.
  /// Of an encoder's error within a turn, by which its scale over a part of the turn is another: counted beside
  /// sigma_scale. 0: there is none.
  double sigma_within_turn_rad = 5e-4;
  bool estimate_skew = true;  ///< Of the axes from being square to each other.
  bool reject_outliers = true;
};

/// The fields of `config` that a user sets: sigma_px, sigma_angle_rad, sigma_square_m, sigma_scale,
/// sigma_within_turn_rad, estimate, scales,
/// outliers. The board has fields of its own.
[[nodiscard]] FieldList fields_of(RigConfig& config);

/// What is wrong with the config, one sentence each; empty where it is usable.
[[nodiscard]] std::vector<std::string> faults(RigConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
