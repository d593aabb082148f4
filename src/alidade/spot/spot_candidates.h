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
  double snr = 0.0;                              ///< SNR of the smoothed peak.
  double strength = 0.0;                         ///< Total light in grey values, corrected to that on white paper.
  bool is_saturated = false;
  std::string reason;  ///< Why it cannot be measured, although it is laser light.
};

/// All patches of light significantly above noise, strongest first. Single pixels, streaks and patches wider than a
/// spot are rejected. In `signal`, single hot pixels are removed, and saturated pixels get the light around them.
[[nodiscard]] std::vector<SpotCandidate> spot_candidates(SpotSignal& signal, const LaserSpotConfig& config);

}  // namespace alidade
