#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rig.h"
#include "alidade/track/track.h"

namespace alidade {

/// What of a track's input a user gave, rather than a file or the data.
struct TrackGiven {
  bool sigma_px = false, sigma_a = false;
  double sigma_clock_s = 0.0;  ///< 0: not given.
};

/// What a head's encoders read.
struct HeadReading {
  std::size_t head = 0;
  Eigen::Vector2d pan_tilt_rad;
};

/// Of each head what it read nearest to that time, if it did within a second.
[[nodiscard]] std::vector<HeadReading> readings_at(std::span<const TargetObservation> observations,
                                                   std::size_t num_heads, double t_s);

/// How a point triangulated by heads at these readings depends on their parameters: ∂ point / ∂ (head_param_names, lens
/// parameters, delay of its clock) of each head, by least squares over their pixels. Empty where they do not determine
/// it.
[[nodiscard]] std::vector<Eigen::MatrixXd> meeting_sensitivity(std::span<const RigHead> heads,
                                                               std::span<const HeadReading> readings,
                                                               const Eigen::Vector3d& point_in_world,
                                                               const Eigen::Vector3d& velocity_in_world);

/// What a track takes as given: lenses, heads, encoders, clocks, noise and the model of motion. `moves`: of the target
/// where half of it was nearer, by the heads' rays meeting elsewhere, in the σ that the track states there. A rig of
/// one head, or a report without a track, moves nothing. Last in one row what of the rig is not tested, if there is
/// any.
[[nodiscard]] std::vector<Assumption> track_assumed(std::span<const TargetObservation> observations, const Rig& rig,
                                                    const FollowConfig& config, const TrackReport& report,
                                                    const TrackGiven& given);

/// What is supposed of when all heads' angles were read: by so much about their images [s]; 0: not given.
[[nodiscard]] std::vector<Assumption> angles_assumed(std::span<const TargetObservation> observations,
                                                     std::span<const RigHead> heads, const TrackReport& report,
                                                     double sigma_s);

/// Adds to every covariance what such a delay of all heads' angles would move the target by.
void count_angle_delay(std::span<const TargetObservation> observations, std::span<const RigHead> heads, double sigma_s,
                       TrackReport& report);

/// What heads have read last: count_angle_delay() of a step as it comes.
class RecentReadings {
 public:
  explicit RecentReadings(std::size_t num_heads) : of_head_(num_heads) {}
  void add(const TargetObservation& observation);
  /// Increases the covariance of a belief of that time.
  void count_delay(std::span<const RigHead> heads, double sigma_s, double t_s, Belief<6>& belief) const;

 private:
  std::vector<std::vector<TargetObservation>> of_head_;  ///< The last two, in order of capture.
};

}  // namespace alidade
