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

/// A mistake under which observations that do not fit the rig would.
struct Explanation {
  std::string what, to_do;
  bool is_foreign_head = false;  ///< One head agrees with none of the others: by its pose, or by its clock.
};

/// A mistake of the table of observations, and what undoes it.
struct TableMisreading {
  Explanation explanation;
  std::function<void(TargetObservation&)> undo;
};

/// Angles in degrees or by another gear, pixels of images of another size, of all heads or of one: those that let the
/// rays come nearest to one another. The observations are in order of capture. Where they fit as they are (`fits`) only
/// such as make what is seen larger: what makes it smaller makes any noise smaller, and so more probable.
[[nodiscard]] std::vector<TableMisreading> misread_units(std::span<const TargetObservation> observations,
                                                         std::span<const RigHead> heads, double together_s, bool fits);

/// Two heads whose rows have the same pixels, one after another: of one image table.
[[nodiscard]] std::optional<Explanation> copied_pixels(std::span<const TargetObservation> observations,
                                                       std::span<const RigHead> heads);

/// How observations fare under a hypothesis, the target being as manoeuvring as suits them best.
struct Trial {
  double ln_p = 0.0;  ///< But for a constant.
  bool fits = false;
};
[[nodiscard]] Trial tried(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                          const FollowConfig& config);

/// Images of all heads, or of one, that are mirrored, flipped, rotated by half a turn or of another size, angles of
/// another unit: heads that follow keep the target near the centre, so that mirrored observations nearly fit. None
/// where the observations fit no better so, or where one of these explains them as well: `faults` of the rig, a clock,
/// a target that falls.
[[nodiscard]] std::optional<Explanation> misread_table(std::span<const TargetObservation> observations,
                                                       std::span<const RigHead> heads, const FollowConfig& config,
                                                       std::span<const RigFault> faults);

/// Swapped heads, exchanged columns, a wrong sign of an angle or a mirrored image, of all heads or of one, units, a
/// head that is not the rig's: the one under which the observations fit and are the most probable. Two of them where
/// they are nearly equally probable; none where none lets the observations fit.
[[nodiscard]] std::optional<Explanation> explanation_of(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config,
                                                        bool fits);

/// Two heads' numbers that are exchanged for a while: their rays meet there once each row is of the other head, and all
/// observations fit then.
[[nodiscard]] std::optional<Explanation> exchanged_rows(std::span<const TargetObservation> observations,
                                                        std::span<const RigHead> heads, const FollowConfig& config);

/// Readings of an axis that are whole steps apart, if these err by more than the encoder's σ says; the coarsest. The
/// check of it, "encoder": its value is that σ [rad].
[[nodiscard]] std::optional<Check> coarse_readings(std::span<const TargetObservation> observations,
                                                   std::span<const RigHead> heads, const FollowConfig& config);
[[nodiscard]] std::string coarse_readings_remedy(const Check& coarse);

/// "the clock of head 2 seems 30 ms behind that of head 1 …"
[[nodiscard]] std::string clock_text(const ClockShift& shift, std::span<const RigHead> heads);

/// Whether most observations of two heads at a time have parallel rays.
[[nodiscard]] bool are_parallel(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                const FollowConfig& config);

/// Why no track began although there were two heads at a time.
[[nodiscard]] Explanation why_no_start(std::span<const TargetObservation> observations, std::span<const RigHead> heads,
                                       const FollowConfig& config);

/// Observations that do not fit, and do where the target may fall; or, where it is said to fall, may do else.
[[nodiscard]] std::optional<Check> falling_target(std::span<const TargetObservation> observations,
                                                  std::span<const RigHead> heads, const FollowConfig& config);

/// Tracks that ended and began again although the target was at one place: its velocity changed at once.
struct VelocityJumps {
  std::size_t num = 0;
  double first_s = 0.0, first_m_s = 0.0;  ///< When the first one was, and by how much.
};

/// Most restarts are such that the path before and the path after, continued with gravity or without, meet between them
/// with another velocity. None where there are fewer than two, or where most do not.
[[nodiscard]] std::optional<VelocityJumps> velocity_jumps(std::span<const TrackStep> steps,
                                                          const TrackerConfig& config);

/// The check of it, "bounces".
[[nodiscard]] Check velocity_jumps_check(const VelocityJumps& jumps);
inline constexpr const char* velocity_jumps_remedy =
    "leave out the positions from each jump to the new start, or give the rows between two jumps by themselves";

}  // namespace alidade
