#pragma once

#include <array>
#include <cstddef>
#include <span>

#include "alidade/localize/filter.h"

namespace alidade {

/// What the mean residual along the radius is, in rings about the principal point.
struct RadialStructure {
  double share = 0.0;          ///< RMS over the rings of the mean residual over σ: 0 for a right lens.
  double chi2_per_ring = 0.0;  ///< Squares of these means over their own σ, were observations independent.
  double worst_px = 0.0;       ///< The largest mean residual.
};

/// Collects what observations are off from the map after their update, outward or inward of the image's middle. A map
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
