#pragma once

#include <span>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/pantilt/rig.h"
#include "alidade/track/track.h"

namespace alidade {

/// Inputs of a track that a user gave, not a file or the data.
struct TrackGiven {
  bool sigma_px = false, sigma_a = false;
  double sigma_clock_s = 0.0;  ///< 0: not given.
};

/// Encoder readings of a head.
struct HeadReading {
  std::size_t head = 0;
  Eigen::Vector2d pan_tilt_rad;
};

/// For each head the reading nearest to that time, if within a second.
[[nodiscard]] std::vector<HeadReading> readings_at(std::span<const TargetObservation> observations,
                                                   std::size_t num_heads, double t_s);

/// Sensitivity of a triangulated point to the parameters of the heads: ∂ point / ∂ (head_param_names, lens
/// parameters, delay of its clock) of each head, by least squares over their pixels. Empty if they do not determine
/// it.
[[nodiscard]] std::vector<Eigen::MatrixXd> meeting_sensitivity(std::span<const RigHead> heads,
                                                               std::span<const HeadReading> readings,
                                                               const Eigen::Vector3d& point_in_world,
                                                               const Eigen::Vector3d& velocity_in_world);

/// Assumptions of a track: lenses, heads, encoders, clocks, noise and motion model. `moves`: how they move the target
/// at its median range, by shifting the intersection of the heads' rays, in units of the σ that the track states there.
/// A rig with one head, or a report without a track, has no moves. The last row names the parts of the rig that are not
/// tested, if there are any.
[[nodiscard]] std::vector<Assumption> track_assumed(std::span<const TargetObservation> observations, const Rig& rig,
                                                    const FollowConfig& config, const TrackReport& report,
                                                    const TrackGiven& given);

/// Assumed delay between the heads' angles and their images [s]; 0: not given.
[[nodiscard]] std::vector<Assumption> angles_assumed(std::span<const TargetObservation> observations,
                                                     std::span<const RigHead> heads, const TrackReport& report,
                                                     double sigma_s);

/// Adds to every covariance the effect on the target of such a delay of all heads' angles.
void count_angle_delay(std::span<const TargetObservation> observations, std::span<const RigHead> heads, double sigma_s,
                       TrackReport& report);

/// The last readings of the heads: count_angle_delay() for a step as it arrives.
class RecentReadings {
 public:
  explicit RecentReadings(std::size_t num_heads) : of_head_(num_heads) {}
  void add(const TargetObservation& observation);
  /// Increases the covariance of a belief at that time.
  void count_delay(std::span<const RigHead> heads, double sigma_s, double t_s, Belief<6>& belief) const;

 private:
  std::vector<std::vector<TargetObservation>> of_head_;  ///< The last two, in order of capture.
};

}  // namespace alidade
