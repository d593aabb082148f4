#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "alidade/localize/filter/filter.h"
#include "alidade/localize/localization.h"

namespace alidade {

/// Collects what observations are off from the map after their update, outward or inward of the image's centre. A map
/// takes up much of what a wrong lens does, but not all at every radius.
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
