#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Readings of a rangefinder, its beam as given, and the path and map against which they are compared.
struct RangeData {
  std::span<const RangeReading> readings;
  Beam beam;
  std::span<const PathStep> path;
  std::span<const MapPoint> map;
};

/// Metres per unit of the path, from one reading.
struct BeamScale {
  double log_scale = 0.0, roughness = 0.0;                 ///< RMS of the points off their plane, over the distance.
  double of_offset = 0.0;                                  ///< ∂scale / ∂(common offset of all readings). [units/m]
  Eigen::Vector2d of_direction = Eigen::Vector2d::Zero();  ///< ∂scale / ∂(direction of the beam). [units/rad]
  double of_time = 0.0;                                    ///< ∂scale / ∂(time of the pose). [units/s]
  Eigen::Vector3d met_in_world = Eigen::Vector3d::Zero();  ///< Where the beam meets the surface. [units]
};

/// One scale per reading, and ln of the ratio to it of another one on which at least half as many readings agree.
struct AgreeingScales {
  std::vector<BeamScale> scales;
  double other_log_scale = 0.0;
};

constexpr std::size_t num_blocks = 10;  ///< Blocks of time; σ is estimated from the scatter between them.

/// One scale per reading: from planes all around the beam, if enough readings have such a plane and agree, else from
/// the nearest points. Empty if too few have a surface.
[[nodiscard]] AgreeingScales scales_of(const RangeData& data);

/// Relative σ of the scale from the beam's covariance; 0.5 % (a usual scale error) if the beam file has none.
[[nodiscard]] double sigma_by_beam(const RangeData& data);

}  // namespace alidade
