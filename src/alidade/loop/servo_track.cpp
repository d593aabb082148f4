#include "alidade/loop/servo_track.h"

namespace alidade {

ServoTrack track_of(const ServoScene& scene, const ServoRun& run) {
  ServoTrack track;
  for (const ServoRow& row : run.rows) {
    if (track.truth.t_s.empty() || row.t_s > track.truth.t_s.back()) {
      track.truth.t_s.push_back(row.t_s);
      track.truth.position.push_back(scene.path.at(row.t_s));
    }
    if (row.seen_px)
      track.sights.push_back({row.t_s, row.t_s + scene.latency_s, row.head, row.measured_rad, *row.seen_px, 0.0});
  }
  TrackConfig config;
  config.tracker.sigma_px = scene.sigma_px;
  config.tracker.sigma_encoder_rad = scene.sigma_encoder_rad;
  config.tracker.errors = scene.rig_errors;
  config.warm_up_s = scene.warm_up_s;
  if (!track.sights.empty()) track.report = track_target(track.sights, scene.heads, config, track.truth);
  return track;
}

}  // namespace alidade
