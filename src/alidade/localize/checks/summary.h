#pragma once

#include <functional>
#include <optional>

#include "alidade/localize/filter/filter_bank.h"
#include "alidade/localize/path/path_smoother.h"

namespace alidade {

/// Fills what a result says of the whole from its path and the filters at the end: counts, NIS, the map, the lens, and
/// with truth the error. `num_used`: how often a point of that id was used.
void sum_up(const FilterBank* bank, const std::function<std::size_t(long id)>& num_used, Localization& result);

/// With truth: how far the path is from it.
void add_path_error(Localization& result);

/// Of the frames' times [s], the same error for all: as given, else by how much an IMU's clock is off them. None: not
/// known, or which of the two clocks is wrong is not.
[[nodiscard]] std::optional<double> sigma_of_times(const LocalizeConfig& config, const Localization& result);

/// Adds to the poses' covariances what the σ of the frames' times, all of them late by the same, moves them by: their
/// velocity, in each pose's frame by its neighbours, times σ [s].
void widen_by_times(double sigma_s, Localization& result);

/// Whether most poses are on the side of a flat target, in the world's x and y, from which it is not seen: as where it
/// or the images are mirrored. A target is seen from its −z.
[[nodiscard]] bool is_behind(std::span<const PathStep> path, std::span<const KnownPoint> target, bool seen_from_plus_z);

/// The map, and the lens, of a smoothed path.
void take_over(const SmoothedPath& smoothed, Localization& result);

/// Σ |ŷ − y|²/σ² over the known points of a map, per component: below 1 on average, as they are also constrained by
/// what was given.
[[nodiscard]] double known_shift(std::span<const MapPoint> map, std::span<const KnownPoint> given);

}  // namespace alidade
