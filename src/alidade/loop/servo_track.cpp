#include "alidade/loop/servo_track.h"

#include <cmath>

#include "alidade/track/checks/lens_over_time.h"
#include "alidade/track/track.h"

namespace alidade {
namespace {

/// The intrinsics that the loop had of each image. A row knows those of the newest image that had arrived.
std::vector<IntrinsicsHistory> histories_of(const ServoScene& scene, const ServoRun& run) {
  std::vector<IntrinsicsHistory> histories(scene.heads.size());
  for (const ServoRow& row : run.rows) {
    IntrinsicsHistory& history = histories[row.head];
    const double image = std::floor((row.t_s - scene.latency_s) / scene.period_s + 1e-6);
    const double captured_s = image * scene.period_s;
    if (image < 0.0 || (!history.t_s.empty() && !(captured_s > history.t_s.back()))) continue;
    history.t_s.push_back(captured_s);
    history.lens.push_back(row.lens);
    history.until_s = row.t_s;
  }
  return histories;
}

}  // namespace

ServoTrack track_of(const ServoScene& scene, const ServoRun& run) {
  ServoTrack track;
  for (const ServoRow& row : run.rows) {
    if (track.truth.t_s.empty() || row.t_s > track.truth.t_s.back()) {
      track.truth.t_s.push_back(row.t_s);
      track.truth.position.push_back(scene.path.at(row.t_s));
    }
    if (row.seen_px)
      track.observations.push_back(
          {row.t_s, row.t_s + scene.latency_s, row.head, row.measured_rad, *row.seen_px, 0.0, {}});
  }
  Rig rig;
  rig.heads = scene.heads;
  if (scene.intrinsics != LensKnowledge::given)
    use_intrinsics_histories(histories_of(scene, run), track.observations, rig);
  FollowConfig config;
  config.tracker.sigma_px = scene.sigma_px;
  config.find_sigma_px = false;
  config.tracker.sigma_encoder_rad = scene.sigma_encoder_rad;
  config.tracker.errors = scene.rig_errors.num() > 0 ? scene.rig_errors : rig_uncertainty(rig);
  config.warm_up_s = scene.warm_up_s;
  if (!track.observations.empty()) track.report = track_target(track.observations, scene.heads, config, track.truth);
  return track;
}

}  // namespace alidade
