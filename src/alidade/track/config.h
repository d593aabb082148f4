#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "alidade/description/field.h"
#include "alidade/public.h"

namespace alidade {
ALIDADE_PUBLIC_BEGIN

/// Motion model of the target: constant velocity, by Singer's model, in a coordinated turn, by interacting
/// models (quiet, agile or falling), in free fall; or the filter of Xiahou, Chen & Wu, 2015, for two heads.
enum class TrackMethod { cv, singer, turn, imm, ballistic, xiahou2015 };

/// Options of track(). What is not given is estimated from the observations, or exact.
struct TrackConfig {
  TrackMethod method = TrackMethod::cv;
  std::optional<Eigen::Vector3d> gravity_m_s2 = {};  ///< In the rig's world, of ballistic and imm: (0, 9.80665, 0).
  bool corrected = false;                            ///< xiahou2015: pixels and mounting corrected, else as printed.
  std::optional<double> predict_s = {};              ///< Also a prediction so far ahead of each observation.
  std::optional<double> smooth_s = {};       ///< Also the path given the observations until so long after; not for imm.
  std::optional<double> sigma_a_m_s2 = {};   ///< The target's acceleration. None: estimated by the innovations.
  std::optional<double> sigma_px = {};       ///< Of a pixel coordinate. None: 0.5, unless the innovations deny it.
  std::optional<double> sigma_clock_s = {};  ///< Of the delay between a head's clock and its images. None: exact.
  double sigma_angle_rad = 0.0008726646259971648;  ///< 0.05°; for heads whose encoder does not state its own.
  double min_depth_m = 0.2, max_depth_m = 20.0;    ///< The rig's working range, along a camera's view.
  int keep_rows = 100000;  ///< Of a TargetTracker's observations: at least so many are kept, at most twice.
};

/// The fields of `config` that a user sets: all of them.
[[nodiscard]] FieldList fields_of(TrackConfig& config);

/// Throws ConfigError with every fault of a config.
void require_sense(TrackConfig config);

ALIDADE_PUBLIC_END
}  // namespace alidade
