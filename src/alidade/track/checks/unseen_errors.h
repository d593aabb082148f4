#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// How far the target moves for an error of a parameter: a share of its range, RMS over the track.
struct TargetMove {
  std::string name;    ///< "head2.pan_zero_rad"
  std::string error;   ///< "0.1°", "1 %": how large the error is.
  double share = 0.0;  ///< Of the range.
};

/// Errors of the rig that may move the target by more than 5σ where half of its positions are nearer, and that the
/// observations then show in half of all logs at most (RigPower): no verdict tests them.
struct UnseenErrors {
  std::vector<const RigPower*> params;  ///< Of TrackReport::power.
  std::vector<TargetMove> worst;        ///< Of each kind (angles, f, centre, positions, scales, clocks) the worst.
  double range_m = 0.0;                 ///< From the first head, the median.
  /// What the rig file lets them move: a share of the range, and in the track's σ. None where it does not say.
  std::optional<double> sigma_share, sigma_in_sigma;
};

[[nodiscard]] UnseenErrors unseen_errors(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads, const TrackerConfig& config, bool rig_is_known,
                                         const TrackReport& report);

/// "errors of pan_zero_rad, camera.cx of head 1, 2 do not show: 0.1° of head2.pan_zero_rad moves the target by 0.87 %
/// of its range (18 mm at 2.1 m), 2 px of head1.camera.cx by …".
[[nodiscard]] std::string unseen_text(const UnseenErrors& unseen);

}  // namespace alidade
