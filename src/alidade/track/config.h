#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Motion model of the target: constant velocity, Singer, coordinated turn, interacting multiple models
/// (quiet, agile or falling), or free fall; or the filter of Xiahou, Chen & Wu, 2015, for two heads.
enum class TrackMethod { cv, singer, turn, imm, ballistic, xiahou2015 };

/// Options of track(). Quantities that are not given are estimated from the observations, or taken as exact.
struct TrackConfig {
  TrackMethod method = TrackMethod::cv;
  std::optional<Eigen::Vector3d> gravity_m_s2 = {};  ///< In the rig's world, for ballistic and imm: (0, 9.80665, 0).
  bool corrected = false;                            ///< xiahou2015: corrected pixels and mounting; false: as printed.
  std::optional<double> predict_s = {};              ///< Also predict this far ahead of each observation.
  std::optional<double> smooth_s = {};      ///< Also smooth, with the observations up to this much later; not for imm.
  std::optional<double> sigma_a_m_s2 = {};  ///< σ of the target's acceleration. None: estimated from the innovations.
  std::optional<double> sigma_px = {};      ///< Of a pixel coordinate. None: 0.5, unless the innovations contradict it.
  std::optional<double> sigma_clock_s = {};  ///< σ of the offset between a head's clock and its images. None: exact.
  double sigma_angle_rad = 0.0008726646259971648;  ///< 0.05°; for heads whose encoders have no σ of their own.
  double min_depth_m = 0.2, max_depth_m = 20.0;    ///< Working range of the rig, along a camera's optical axis.
  int keep_rows = 100000;  ///< Number of observations that a TargetTracker keeps: at least this many, at most twice.
};

/// The fields of `config` that a user sets: all of them.
[[nodiscard]] FieldList fields_of(TrackConfig& config);

/// Throws ConfigError with every fault of a config.
void require_sense(TrackConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
