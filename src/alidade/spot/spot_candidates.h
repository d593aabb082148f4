#pragma once

#include <string>
#include <vector>

#include "alidade/spot/laser_spot.h"
#include "alidade/spot/spot_signal.h"

namespace alidade {

/// A patch of light that may be a laser spot.
struct SpotCandidate {
  Eigen::Vector2d px = Eigen::Vector2d::Zero();  ///< Centroid, in pixels of the signal's part.
  double radius_px = 0.0;                        ///< σ, mean of its axes.
  double snr = 0.0;                              ///< Of the smoothed peak.
  double strength = 0.0;                         ///< Its light in grey values, as white paper would have returned it.
  bool is_saturated = false;
  std::string reason;  ///< Why it cannot be measured, though it is the laser's light.
};

/// All patches of light that stand out of the noise, strongest first. Single pixels, streaks and what is wider than a
/// spot are rejected. In `signal` single hot pixels are taken away, and what saturates gets the light around it.
[[nodiscard]] std::vector<SpotCandidate> spot_candidates(SpotSignal& signal, const LaserSpotConfig& config);

}  // namespace alidade
