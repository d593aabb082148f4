#pragma once

#include <array>
#include <optional>
#include <span>
#include <vector>

#include "alidade/pantilt/head.h"
#include "alidade/pantilt/target_observation.h"
#include "alidade/track/track_step.h"
#include "alidade/track/xiahou_filter.h"

namespace alidade {

/// The filter of Xiahou et al. on observations as they arrive: one step whenever both heads have seen the target within
/// 60 ms. Uses the first two heads; its steps have a position and σ in the world, and no innovations.
class XiahouTracker {
 public:
  XiahouTracker(std::span<const RigHead> heads, const XiahouConfig& config);
  TrackStep take(const TargetObservation& observation);

 private:
  [[nodiscard]] TrackStep step_now() const;

  std::vector<RigHead> heads_;
  XiahouConfig config_;
  Eigen::Vector3d origin_in_world_;
  std::optional<XiahouFilter> filter_;
  std::array<std::optional<TargetObservation>, 2> last_;
  double filter_time_s_ = 0.0;
};

}  // namespace alidade
