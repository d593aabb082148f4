#pragma once

#include <span>
#include <string>
#include <vector>

#include "alidade/track/track.h"

namespace alidade {

/// Threshold for a fault: with a correct rig, whose z are standard normal, and some fifteen independent parameters, one
/// track in 150 exceeds it. If the rig's errors are not given, chance alone is compared.
[[nodiscard]] inline double max_fault_z(const TrackReport& report) { return report.errors_are_counted ? 3.5 : 5.0; }

/// The faults, the most significant first, and the power of the tests.
struct RigTests {
  std::vector<RigFault> faults;
  std::vector<RigPower> power;
};

/// Tests each parameter of each head on its own: the gain if it were free beyond what the rig file
/// allows (score test: C. R. Rao, 1948). The observations are in order of capture, and linearised along one path, from
/// which the target may deviate anywhere. Empty if they determine no path.
[[nodiscard]] RigTests rig_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                  const TrackerConfig& config);

/// Whether a fault explains the observations as well as the first, by the score test or re-estimated: with this
/// difference of ln p the choice may be wrong once in 20.
[[nodiscard]] bool is_alike(const RigFault& first, const RigFault& fault);

/// The first fault, if it is significant, and for each head the first of those that explain the observations as well.
[[nodiscard]] std::vector<RigFault> alike_per_head(const TrackReport& report);

/// The rig with the fault corrected, and the observations with the corresponding times.
struct WithoutFault {
  std::vector<RigHead> heads;
  std::vector<TargetObservation> observations;
};
[[nodiscard]] WithoutFault without_fault(std::span<const TargetObservation> observations,
                                         std::span<const RigHead> heads, const RigFault& fault);

/// For each head the most significant parameter other than its clock, if it may explain what a clock would.
[[nodiscard]] std::vector<RigFault> rivals_of_clocks(const TrackReport& report);

/// Whether one parameter of the rig explains the misfit, so that no other cause is searched for.
[[nodiscard]] bool is_explained_by_fault(const TrackReport& report);

/// If there is a fault: increases σ by its effect, and determines whether the observations fit once it is corrected.
void heed_faults(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                 const FollowConfig& config, TrackReport& report);

/// "the observations say that head2.pan_zero_rad is off by 0.0053 (6.6σ of what the rig file allows), which cannot be
/// told apart from head2.base_ry_rad".
[[nodiscard]] std::string fault_text(const TrackReport& report);

/// "calibrate head 2 again as it stands now (alidade rig)".
[[nodiscard]] std::string fault_remedy(const TrackReport& report, std::span<const RigHead> heads);

}  // namespace alidade
