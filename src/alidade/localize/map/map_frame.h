#pragma once

#include <Eigen/Core>

#include "alidade/localize/localization.h"

namespace alidade {

/// How a place moves, so far away from the centre, with a motion of the world and its size: translation [m], rotation
/// [rad], relative size.
[[nodiscard]] Eigen::Matrix<double, 3, 7> similarity_moves(const Eigen::Vector3d& away);

/// The same error, by what it is about another centre.
[[nodiscard]] SavedFrame about_centre(const SavedFrame& frame, const Eigen::Vector3d& centre);

/// The frame of a map whose unit becomes `scale`, known to `sigma_rel`, about the origin.
[[nodiscard]] SavedFrame scaled_frame(SavedFrame frame, double scale, double sigma_rel);

/// A path and its map in the frame of an earlier one: that frame's own error moves all of it alike.
void widen_by_frame(const SavedFrame& frame, Localization& result);

}  // namespace alidade
