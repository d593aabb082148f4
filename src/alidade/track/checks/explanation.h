#pragma once

#include <functional>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "alidade/estimation/verdict.h"
#include "alidade/track/track.h"

namespace alidade {

struct ClockShift;

/// A mistake that would explain why observations do not fit the rig.
struct Explanation {
  std::string what, to_do;
  bool is_foreign_head = false;  ///< One head disagrees with all others: in its pose, or in its clock.
};

/// A mistake in the table of observations, and its correction.
struct TableMisreading {
  Explanation explanation;
  std::function<void(TargetObservation&)> undo;
};

/// Angles in degrees or with another gear ratio, pixels of images of another size, of all heads or of one: the case
/// with the smallest distance between the rays. The observations are in order of capture. If they fit as they are
/// (`fits`), only alternatives that enlarge what is seen: reducing it also reduces any noise and is thus more probable.
[[nodiscard]] std::vector<TableMisreading> misread_units(std::span<const TargetObservation> observations,
                                                         std::span<const RigHead> heads, double together_s, bool fits);

/// Two heads with the same pixels in consecutive rows: both read from one image table.
[[nodiscard]] std::optional<Explanation> copied_pixels(std::span<const TargetObservation> observations,
                                                       std::span<const RigHead> heads);

/// Observations under a hypothesis, with the best-fitting manoeuvre intensity of the target.
struct Trial {
  double ln_p = 0.0;  ///< Up to a constant.
  bool fits = false;
};
[[nodiscard]] Trial tried(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                          const FollowConfig& config);

/// Images of all heads, or of one, that are mirrored, flipped, rotated by 180° or of another size, angles in
/// another unit: heads that follow keep the target near the centre, so that mirrored observations nearly fit. None
/// if the observations do not fit better this way, or if one of these explains them as well: `faults` of the rig, a
/// clock, a falling target.
[[nodiscard]] std::optional<Explanation> misread_table(std::span<const TargetObservation> observations,
                                                       std::span<const RigHead> heads, const FollowConfig& config,
                                                       std::span<const RigFault> faults);

/// Swapped heads, exchanged columns, a wrong sign of an angle or a mirrored image, of all heads or of one, units, a
/// head that does not belong to the rig: the one under which the observations fit and are most probable. Two of them if
/// they are nearly equally probable; none if none lets the observations fit.
[[nodiscard]] std::optional<Explanation> explanation_of(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config,
                                                        bool fits);

/// Two heads' numbers exchanged for a while: their rays meet there once each row is assigned to the other head, and all
/// observations then fit.
[[nodiscard]] std::optional<Explanation> exchanged_rows(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config);

/// Readings of an axis with a visible resolution, if its error exceeds the encoder's σ; the coarsest one. The
/// check "encoder": its value is that σ [rad].
[[nodiscard]] std::optional<Check> coarse_readings(std::span<const TargetObservation> observations,
                                                   std::span<const RigHead> heads, const FollowConfig& config);
[[nodiscard]] std::string coarse_readings_remedy(const Check& coarse);

/// "the clock of head 2 seems 30 ms behind that of head 1 …"
[[nodiscard]] std::string clock_text(const ClockShift& shift, std::span<const RigHead> heads);

/// Whether most pairs of simultaneous observations by two heads have parallel rays.
[[nodiscard]] bool are_parallel(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const FollowConfig& config);

/// Why no track was initialised although two heads observed simultaneously.
[[nodiscard]] Explanation why_no_start(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const FollowConfig& config);

/// Observations that do not fit, but do if the target may fall; or, if it is declared to fall, if it need not.
[[nodiscard]] std::optional<Check> falling_target(std::span<const TargetObservation> observations,
                                                  std::span<const RigHead> heads, const FollowConfig& config);

/// Tracks that ended and restarted although the target was at one place: its velocity changed suddenly.
struct VelocityJumps {
  std::size_t num = 0;
  double first_s = 0.0, first_m_s = 0.0;  ///< Time of the first one, and its change of velocity.
};

/// Most restarts are such that the paths before and after, continued with gravity or without, meet between them
/// with different velocities. None for fewer than two restarts, or if most are not of this kind.
[[nodiscard]] std::optional<VelocityJumps> velocity_jumps(std::span<const TrackStep> steps,
                                                          const TrackerConfig& config);

/// The check "bounces".
[[nodiscard]] Check velocity_jumps_check(const VelocityJumps& jumps);
inline constexpr const char* velocity_jumps_remedy =
    "leave out the positions from each jump to the new start, or give the rows between two jumps by themselves";

}  // namespace alidade
