#include "alidade/reproduce/track_trials.h"

namespace alidade::reproduce {

std::vector<TargetObservation> observations_of(const TrackScene& scene, std::uint64_t seed) {
  std::vector<TargetObservation> observations;
  for (const SimulatedObservation& s : simulate_track(scene, seed))
    observations.push_back({s.t_capture_s, s.t_arrival_s, s.head, s.pan_tilt_rad, s.px});
  return observations;
}

TrueTrack truth_of(const TrackScene& scene) {
  TrueTrack truth;
  for (int k = 0; k <= static_cast<int>(scene.duration_s * 200.0); ++k) {
    truth.t_s.push_back(k / 200.0);
    truth.position.push_back(scene.position(k / 200.0));
  }
  return truth;
}

}  // namespace alidade::reproduce
