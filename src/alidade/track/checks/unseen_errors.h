#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// Motion of the target for an error of a parameter: relative to its range, RMS over the track.
struct TargetMove {
  std::string name;    ///< "head2.pan_zero_rad"
  std::string error;   ///< "0.1°", "1 %": the size of the error.
  double share = 0.0;  ///< Relative to the range.
};

/// Errors of the rig that may move the target by more than 5σ at half of its positions, and that the
/// observations would reveal in half of all logs at most (RigPower): no verdict tests them.
struct UnseenErrors {
  std::vector<const RigPower*> params;  ///< Of TrackReport::power.
  std::vector<TargetMove> worst;        ///< The worst one of each kind (angles, f, centre, positions, scales, clocks).
  double range_m = 0.0;                 ///< Median range from the first head.
  /// Effect of the errors that the rig file allows, relative to the range and in the track's σ. None if it has none.
  std::optional<double> sigma_share, sigma_in_sigma;
};

[[nodiscard]] UnseenErrors unseen_errors(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads, const TrackerConfig& config, bool rig_is_known,
                                         const TrackReport& report);

/// "errors of pan_zero_rad, camera.cx of head 1, 2 do not show: 0.1° of head2.pan_zero_rad moves the target by 0.87 %
/// of its range (18 mm at 2.1 m), 2 px of head1.camera.cx by …".
[[nodiscard]] std::string unseen_text(const UnseenErrors& unseen);

}  // namespace alidade
