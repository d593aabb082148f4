#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// A fault is one that is more significant: of a right rig, whose z are normal, with some fifteen of the parameters
/// independent, one track in 150 has such a one. Where the rig's errors are not given, only those of chance.
[[nodiscard]] inline double max_fault_z(const TrackReport& report) { return report.errors_are_counted ? 3.5 : 5.0; }

/// Of what is tested the faults, the most significant first, and the power.
struct RigTests {
  std::vector<RigFault> faults;
  std::vector<RigPower> power;
};

/// Tests each parameter of each head alone: what the observations would gain if it were free beside what the rig file
/// allows (score test: C. R. Rao, 1948). They are in order of capture, and linearised along one path, about which the
/// target may go anywhere. Empty where they determine no path.
[[nodiscard]] RigTests rig_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                  const TrackerConfig& config);

/// Whether a fault explains the observations as well as the first, by the score test or refitted: of so much ln p a
/// choice may err once in 20.
[[nodiscard]] bool is_alike(const RigFault& first, const RigFault& fault);

/// The first fault, if it is significant, and of each head the first of those that explain the observations as well.
[[nodiscard]] std::vector<RigFault> alike_per_head(const TrackReport& report);

/// The rig without the fault, and the observations at the times that they then have.
struct WithoutFault {
  std::vector<RigHead> heads;
  std::vector<TargetObservation> observations;
};
[[nodiscard]] WithoutFault without_fault(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads, const RigFault& fault);

/// Of each head the most significant parameter that is not its clock's, if it may explain what a clock would.
[[nodiscard]] std::vector<RigFault> rivals_of_clocks(const TrackReport& report);

/// Where one parameter of the rig explains what does not fit, no one looks for other reasons.
[[nodiscard]] bool is_explained_by_fault(const TrackReport& report);

/// Where there is a fault: increases σ by what it moves, and determines whether the observations fit without it.
void heed_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                 const FollowConfig& config, TrackReport& report);

/// "the observations say that head2.pan_zero_rad is off by 0.0053 (6.6σ of what the rig file allows), which cannot be
/// told apart from head2.base_ry_rad".
[[nodiscard]] std::string fault_text(const TrackReport& report);

/// "calibrate head 2 again as it stands now (alidade rig)".
[[nodiscard]] std::string fault_remedy(const TrackReport& report, std::span<const RigHead> heads);

}  // namespace alidade
