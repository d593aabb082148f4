#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "alidade/localize/config.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Readings of a rangefinder, its beam as given, and what they meet.
struct RangeData {
  std::span<const RangeReading> readings;
  Beam beam;
  std::span<const PathStep> path;
  std::span<const MapPoint> map;
};

/// Metres a unit of the path by one reading.
struct BeamScale {
  double log_scale = 0.0, roughness = 0.0;                 ///< The points off their plane, over the distance.
  double of_offset = 0.0;                                  ///< ∂scale / ∂(length of all readings). [units/m]
  Eigen::Vector2d of_direction = Eigen::Vector2d::Zero();  ///< ∂scale / ∂(direction of the beam). [units/rad]
  double of_time = 0.0;                                    ///< ∂scale / ∂(time of the pose). [units/s]
  Eigen::Vector3d met_in_world = Eigen::Vector3d::Zero();  ///< Where the beam meets the surface. [units]
};

/// One scale of each reading, and ln of another over it that at least half as many of them have.
struct AgreeingScales {
  std::vector<BeamScale> scales;
  double other_log_scale = 0.0;
};

constexpr std::size_t num_blocks = 10;  ///< Of time, by whose scatter σ is.

/// One scale of each reading: by planes all around the beam, where enough have them and agree, else by the nearest
/// points. Empty where too few have a surface.
[[nodiscard]] AgreeingScales scales_of(const RangeData& data);

/// σ of the scale by what is not known of the beam: an ordinary 0.5 % of its scale where the file says nothing.
[[nodiscard]] double sigma_by_beam(const RangeData& data);

}  // namespace alidade
