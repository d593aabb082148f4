#pragma once

#include <functional>
#include <optional>

#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Fills the summary of a result from its path and the filters at the end: counts, NIS, the map, the lens, and with
/// truth the error. `num_used`: how often a point of that id was used.
void sum_up(const FilterBank* bank, const std::function<std::size_t(long id)>& num_used, Localization& result);

/// With truth: the error of the path.
void add_path_error(Localization& result);

/// σ of a common error of the frames' times [s]: as given, else the difference to an IMU's clock. Empty: unknown, or
/// unknown which of the two clocks is wrong.
[[nodiscard]] std::optional<double> sigma_of_times(const LocalizeConfig& config, const Localization& result);

/// Adds the effect of a common delay of the frames' times, with that σ [s], to the poses' covariances: the velocity in
/// each pose's frame, from its neighbours, times σ.
void widen_by_times(double sigma_s, Localization& result);

/// Whether most poses are behind a flat target, in the world's x and y: as if it or the images were mirrored. A target
/// is seen from its −z.
[[nodiscard]] bool is_behind(std::span<const PathStep> path, std::span<const KnownPoint> target, bool seen_from_plus_z);

/// Takes map and lens from a smoothed path.
void take_over(const SmoothedPath& smoothed, Localization& result);

/// Σ |ŷ − y|²/σ² over the known points of a map, per component: below 1 on average, because their given positions also
/// constrain the estimate.
[[nodiscard]] double known_shift(std::span<const MapPoint> map, std::span<const KnownPoint> given);

}  // namespace alidade
