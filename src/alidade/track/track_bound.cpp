#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

#include "alidade/track/track.h"

namespace alidade {

std::vector<double> track_bound(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const FollowConfig& config, const TrueTrack& truth) {
  std::vector<std::size_t> order(observations.size());
  std::iota(order.begin(), order.end(), 0u);
  std::ranges::stable_sort(order, {}, [&](std::size_t i) { return observations[i].t_capture_s; });
  const ConstantVelocity motion{config.tracker.sigma_a_m_s2};
  Belief<6> belief;
  belief.P.topLeftCorner<3, 3>() *= config.tracker.start_sigma_m * config.tracker.start_sigma_m;
  belief.P.bottomRightCorner<3, 3>() *= config.tracker.start_sigma_v_m_s * config.tracker.start_sigma_v_m_s;
  std::vector<double> sigma_m(observations.size(), std::numeric_limits<double>::quiet_NaN());
  double now_s = order.empty() ? 0.0 : observations[order.front()].t_capture_s;
  for (const std::size_t i : order) {
    const TargetObservation& observation = observations[i];
    belief = motion.predicted(belief, observation.t_capture_s - now_s);
    now_s = observation.t_capture_s;
    const auto position = truth.at(now_s);
    if (position && observation.head < heads.size()) {
      const RigHead& head = heads[observation.head];
      const double own = head.head.encoder.sigma_rad;
      const ObservationModel see(head, observation.pan_tilt_rad, sigma_px_of(observation, config.tracker.sigma_px),
                                 own > 0.0 ? own : config.tracker.sigma_encoder_rad, observation.lens);
      belief.x.head<3>() = *position;
      if (const auto seen = see(*position)) {
        const auto updated = iterated_update(belief, *seen, seen->z, see, {.max_iterations = 1});
        if (updated) belief = *updated;
      }
    }
    sigma_m[i] = std::sqrt(belief.P.topLeftCorner<3, 3>().trace());
  }
  return sigma_m;
}

}  // namespace alidade
