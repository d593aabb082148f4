#pragma once

#include "alidade/localize/localization.h"

namespace alidade {

/// What the path takes as given: the camera, and the target's scale.
[[nodiscard]] std::vector<Assumption> localize_assumed(const Localization& result);

/// Where the times were made of a rate though the video has its own, another one by more than 1 %: so assumed. 0: none.
void add_rate_assumed(double own_rate_hz, Localization& result);

/// Whether the path stands. A path that its observations contradict is never good.
[[nodiscard]] Verdict localize_verdict(const Localization& result);

/// Whether the filter's poses of the frames in `recent` stand, before the path is solved as a whole: its path is theirs
/// alone.
[[nodiscard]] Verdict live_verdict(const Localization& recent);

/// Why an IMU's readings have no part in the path; empty where they have.
[[nodiscard]] std::string imu_fault_text(const ImuEstimate& imu);
/// Whether an IMU's clock and the frames' times are apart by more than is ordinary, and by more than moves a pose by σ:
/// which of them is wrong is not known.
[[nodiscard]] bool clocks_differ(const Localization& report);
/// Checks of those that have.
void add_imu(const Localization& report, Verdict& verdict);

/// What of a map that an earlier run has left is no longer so, or not known.
void add_map(const Localization& report, Verdict& verdict);

/// The sensors that say how long the path is: "depth sensor, ± 0.2 %".
[[nodiscard]] std::string sensors_text(const Localization& report);
/// What sensors beside the camera say of a scale that is known without them, and two of them of each other.
void add_sensors(const Localization& report, Verdict& verdict);

/// Where σ has what of the focal length, or of the centre, the observations would not show.
void add_hidden(const Localization& report, Verdict& verdict);

/// Bad above `bad`, else care above `care`.
[[nodiscard]] State state_of(double value, double care, double bad);

/// |z| of what a score asks, with what anybody would believe of a lens: of one about which the observations know less
/// than that, as those of a still camera, nothing is said.
[[nodiscard]] double supported_z(const GivenNumber& given, const Camera& camera);

/// By how many of its σ the path moves where something given is as the observations ask: of a target that does not
/// stand still also by where it was half of the time before or after its mean, as the world is then anywhere between.
[[nodiscard]] double moved_sigmas(const GivenNumber& given, const Localization& result);

/// Its score over that from which on it is doubted: above 1. Water of another index, and where pixels are found to be
/// worse than usual another focal length, move the path by more of its σ than they show: there from a lower score on.
[[nodiscard]] double doubt_of(const GivenNumber& given, const Localization& report);

/// What the observations ask of something given, with its size; where the path is solved with an IMU, together with its
/// readings.
[[nodiscard]] std::string cause_text(const GivenNumber& given, const Localization& result);

/// Of a lens that the observations contradict, what of it is not as it was given: "focal length +2.1 % (12σ), centre u
/// -3 px (8σ), k1 -0.02 (20σ)".
[[nodiscard]] std::string lens_changes(const Localization& result);

}  // namespace alidade
