#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Collects the radial component of residuals, about the image centre, after the map's update. A map absorbs much of
/// the effect of a wrong lens, but not all of it at every radius.
class RadialResiduals {
 public:
  void add(const LocalizationFilter& filter, std::span<const FeatureObservation> observations,
           std::span<const ObservationOutcome> outcomes);
  [[nodiscard]] RadialStructure structure() const;

 private:
  static constexpr std::size_t num_rings = 6;
  struct Ring {
    double num = 0.0, sum = 0.0, sum_px = 0.0;
  };
  std::array<Ring, num_rings> rings_{};
};

}  // namespace alidade
