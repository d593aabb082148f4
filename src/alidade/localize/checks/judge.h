#pragma once

#include "alidade/localize/localization.h"

namespace alidade {

/// The assumptions of a path: the camera, and the scale of the target.
[[nodiscard]] std::vector<Assumption> localize_assumed(const Localization& result);

/// Records an assumed frame rate, if the video has its own, different by more than 1 %. 0: it has none.
void add_rate_assumed(double own_rate_hz, Localization& result);

/// Verdict on a path. A path that is contradicted by its observations is never good.
[[nodiscard]] Verdict localize_verdict(const Localization& result);

/// Verdict on the filter's poses of the frames in `recent`, before the path is solved as a whole: based on these
/// alone.
[[nodiscard]] Verdict live_verdict(const Localization& recent);

/// Why an IMU's readings are not used for the path; empty if they are.
[[nodiscard]] std::string imu_fault_text(const ImuEstimate& imu);
/// Whether the IMU's clock and the frames' times differ by more than is ordinary, and by more than moves a pose by σ:
/// which of them is wrong is not known.
[[nodiscard]] bool clocks_differ(const Localization& report);
/// Adds checks of IMU readings that are used.
void add_imu(const Localization& report, Verdict& verdict);

/// Adds checks of the map of an earlier run: what has changed since, or is unknown.
void add_map(const Localization& report, Verdict& verdict);

/// The sensors that determine the scale of the path: "depth sensor, ± 0.2 %".
[[nodiscard]] std::string sensors_text(const Localization& report);
/// Compares the scales by other sensors with a scale that is known without them, and with each other.
void add_sensors(const Localization& report, Verdict& verdict);

/// Reports where σ includes an undetectable error of the focal length or the centre.
void add_hidden(const Localization& report, Verdict& verdict);

/// State bad above `bad`, else care above `care`.
[[nodiscard]] State state_of(double value, double care, double bad);

/// |z| of a score test, combined with a wide prior of lens parameters: if the observations determine one less precisely
/// than that, as those of a still camera do, z is reduced.
[[nodiscard]] double supported_z(const GivenNumber& given, const Camera& camera);

/// Change of the path, in its σ, by the change that a score test indicates; for a moving target also its displacement
/// in half of the time span, since the world frame is then uncertain by that.
[[nodiscard]] double moved_sigmas(const GivenNumber& given, const Localization& result);

/// Score over its limit: doubtful above 1. Water of another index, and (where pixel noise is found to be larger than
/// usual) another focal length, move the path by more of its σ than their score shows: the limit is then lower.
[[nodiscard]] double doubt_of(const GivenNumber& given, const Localization& report);

/// The change of a given number that the observations indicate, with its size; with an IMU, observations and IMU
/// readings together.
[[nodiscard]] std::string cause_text(const GivenNumber& given, const Localization& result);

/// For a lens that the observations contradict, its differences from the given one: "focal length +2.1 % (12σ), centre
/// u -3 px (8σ), k1 -0.02 (20σ)".
[[nodiscard]] std::string lens_changes(const Localization& result);

}  // namespace alidade
